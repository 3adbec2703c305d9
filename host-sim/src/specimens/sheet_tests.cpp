#include "specimens/sheet_tests.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "generators/grid_triangles.hpp"
#include "haptic/sim/model_settings.hpp"
#include "specimens/relaxation.hpp"

namespace haptic::sim {
namespace {

constexpr double kPulledStrain = 0.005;
constexpr double kStripSag = 0.01;  // of the strip's length
constexpr std::uint32_t kStripColumns = 25;
constexpr std::uint32_t kStripRows = 7;
constexpr std::uint32_t kRings = 40;    // of the disc; half as many lock light fabrics. The 24th is the support's edge
constexpr double kRipple = 1e-3;        // m, at the edge of the disc: a start without symmetry, from which folds grow
constexpr double kShadowCell = 2.5e-4;  // m
constexpr double kEarth = 9.81;         // m/s^2

/// The model as a scene would have it, with a particle at each vertex.
ParticleModel sheet_of(TriangleMesh mesh, const SheetMaterial& material) {
    ModelSettings settings;
    settings.file = "virtual test";
    settings.mesh = std::make_shared<const TriangleMesh>(std::move(mesh));
    settings.file_scale = 1.0;
    settings.builder.particles = 0;
    settings.material = MaterialSettings{.name = "",
                                         .young_modulus = {},
                                         .poisson_ratio = material.poisson_ratio,
                                         .density = {},
                                         .membrane_stiffness = material.membrane_stiffness,
                                         .bending_stiffness = material.bending_stiffness,
                                         .areal_density = material.areal_density,
                                         .damping = material.damping};
    return make_body(settings).particles;
}

/// A grid in the x-z plane from the origin, its diagonals alternating as those of the cloth.
TriangleMesh flat_grid(std::uint32_t columns, std::uint32_t rows, double spacing) {
    TriangleMesh mesh;
    for (std::uint32_t j = 0; j < rows; ++j) {
        for (std::uint32_t i = 0; i < columns; ++i) {
            mesh.vertices.emplace_back(spacing * i, 0.0, spacing * j);
        }
    }
    mesh.triangles = grid_triangles(columns, rows);
    return mesh;
}

/// A disc in the x-z plane: ring k has 6 k vertices.
TriangleMesh flat_disc() {
    TriangleMesh mesh;
    mesh.vertices.emplace_back(0.0);
    const auto vertex = [](std::uint32_t ring, std::uint32_t i) {
        return ring == 0 ? 0U : 1U + 3U * ring * (ring - 1U) + i % (6U * ring);
    };
    for (std::uint32_t ring = 1; ring <= kRings; ++ring) {
        const double radius = Drape::kDisc * ring / kRings;
        for (std::uint32_t i = 0; i < 6 * ring; ++i) {
            const double angle = 2.0 * std::numbers::pi * i / (6.0 * ring);
            mesh.vertices.emplace_back(radius * std::cos(angle), 0.0, radius * std::sin(angle));
        }
        // Six sectors, each with `ring` triangles outward and one fewer inward.
        for (std::uint32_t sector = 0; sector < 6; ++sector) {
            for (std::uint32_t i = 0; i < ring; ++i) {
                const std::uint32_t outer = vertex(ring, sector * ring + i);
                const std::uint32_t next = vertex(ring, sector * ring + i + 1);
                const std::uint32_t inner = vertex(ring - 1, sector * (ring - 1) + i);
                mesh.triangles.push_back({outer, inner, next});
                if (i + 1 < ring) {
                    mesh.triangles.push_back({inner, vertex(ring - 1, sector * (ring - 1) + i + 1), next});
                }
            }
        }
    }
    return mesh;
}

double mass_of(const ParticleModel& model) {
    double mass = 0.0;
    for (const double m : model.mass) {
        mass += m;
    }
    return mass;
}

RelaxationSettings relaxation_of(const SheetTest& test, double gravity) {
    return {.step = test.step, .substeps = test.substeps, .gravity = Vec3(0.0, -gravity, 0.0)};
}

/// Maxima of the height along the edge of the disc that stand out by a tenth of the height's range.
int folds_of(const TriangleMesh& disc) {
    const std::size_t count = std::size_t{6} * kRings;
    const std::size_t first = disc.vertices.size() - count;
    double low = disc.vertices[first].y;
    double high = low;
    for (std::size_t i = 0; i < count; ++i) {
        low = std::min(low, disc.vertices[first + i].y);
        high = std::max(high, disc.vertices[first + i].y);
    }
    const double margin = 0.1 * (high - low);
    if (high - low < kRipple) {
        return 0;
    }
    // Twice round the edge: the first round finds the state at its start.
    int folds = 0;
    bool up = false;
    double last = disc.vertices[first].y;  // extreme since the last turn
    for (std::size_t k = 0; k < 2 * count; ++k) {
        const double y = disc.vertices[first + k % count].y;
        last = up ? std::max(last, y) : std::min(last, y);
        if (up && y < last - margin) {
            up = false;
            folds += k >= count ? 1 : 0;
            last = y;
        } else if (!up && y > last + margin) {
            up = true;
            last = y;
        }
    }
    return folds;
}

}  // namespace

SheetMeasured measure_membrane(const SheetTest& test) {
    if (test.vertices_per_side < SheetTest::kFewestPerSide) {
        throw std::invalid_argument("sheet tests: a square needs at least " +
                                    std::to_string(SheetTest::kFewestPerSide) + " vertices per side");
    }
    const std::uint32_t cells = test.vertices_per_side - 1;
    const double spacing = test.side / cells;
    ParticleModel model = sheet_of(flat_grid(test.vertices_per_side, test.vertices_per_side, spacing), test.material);
    // The pull per length, on each vertex of both edges by its share of them.
    const double pull = kPulledStrain * test.material.membrane_stiffness;
    std::vector<Vec3> force(model.size(), Vec3(0.0));
    for (std::size_t i = 0; i < model.size(); ++i) {
        const std::size_t column = i % test.vertices_per_side;
        const std::size_t row = i / test.vertices_per_side;
        const double share = row == 0 || row == cells ? 0.5 * spacing : spacing;
        force[i].x = column == 0 ? -pull * share : column == cells ? pull * share : 0.0;
    }
    const Relaxed relaxed = relax(model, force, relaxation_of(test, 0.0));
    // An affine map of the middle half, by least squares.
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Matrix<double, 3, 2> side = Eigen::Matrix<double, 3, 2>::Zero();
    for (std::size_t i = 0; i < model.size(); ++i) {
        const Vec3 from = model.rest_position[i] - Vec3(0.5 * test.side, 0.0, 0.5 * test.side);
        if (std::abs(from.x) <= 0.25 * test.side && std::abs(from.z) <= 0.25 * test.side) {
            const Eigen::Vector3d row(1.0, from.x, from.z);
            const Vec3 moved = model.position[i] - model.rest_position[i];
            normal += row * row.transpose();
            side += row * Eigen::RowVector2d(moved.x, moved.z);
        }
    }
    const Eigen::Matrix<double, 3, 2> fit = normal.ldlt().solve(side);
    return {.value = pull / fit(1, 0),
            .poisson_ratio = -fit(2, 1) / fit(1, 0),
            .areal_density = mass_of(model) / (test.side * test.side),
            .substeps = relaxed.substeps,
            .simulated_s = relaxed.simulated_s,
            .at_rest = relaxed.at_rest};
}

SheetMeasured measure_sheet_bending(const SheetTest& test) {
    const double stiffness = test.material.bending_stiffness;
    if (!(stiffness > 0.0)) {
        throw std::invalid_argument("sheet tests: the sheet has no bending stiffness to measure");
    }
    const double length = test.strip;
    const double spacing = length / (kStripColumns - 1);
    ParticleModel model = sheet_of(flat_grid(kStripColumns, kStripRows, spacing), test.material);
    for (std::size_t i = 0; i < model.size(); ++i) {
        model.pinned[i] = i % kStripColumns < 2 ? 1 : 0;
    }
    // Held up to the middle between the second column, which already bends, and the first.
    const double held = 0.5 * spacing;
    const double l = length - held;
    const double density = test.material.areal_density;
    const double gravity = kStripSag * 8.0 * stiffness / (density * l * l * l);
    const Relaxed relaxed = relax(model, {}, relaxation_of(test, gravity));
    // Height = a + b x + k line(x), by least squares.
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d side = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < model.size(); ++i) {
        if (model.pinned[i] == 0) {
            const double x = model.rest_position[i].x - held;
            const double line = x * x * (6.0 * l * l - 4.0 * l * x + x * x) / (24.0 * kStripSag * l * l * l);
            const Eigen::Vector3d row(1.0, x / l, line / l);
            normal += row * row.transpose();
            side += row * (model.position[i].y - model.rest_position[i].y);
        }
    }
    const Eigen::Vector3d fit = normal.ldlt().solve(side);
    const double weight = density * gravity;
    return {.value = -weight * kStripSag * l * l * l * l / fit[2],
            .areal_density = mass_of(model) / (length * spacing * (kStripRows - 1)),
            .substeps = relaxed.substeps,
            .simulated_s = relaxed.simulated_s,
            .at_rest = relaxed.at_rest};
}

double shadow_area(const TriangleMesh& mesh) {
    Vec3 low = mesh.vertices.front();
    Vec3 high = low;
    for (const Vec3& p : mesh.vertices) {
        low = glm::min(low, p);
        high = glm::max(high, p);
    }
    // Cells whose middle is in the shadow of a triangle.
    const auto columns = static_cast<std::size_t>((high.x - low.x) / kShadowCell) + 1;
    const auto rows = static_cast<std::size_t>((high.z - low.z) / kShadowCell) + 1;
    std::vector<bool> dark(columns * rows, false);
    const auto cell_of = [](double offset) { return static_cast<std::size_t>(std::max(offset / kShadowCell, 0.0)); };
    for (const Triangle& corner : mesh.triangles) {
        const Vec3& a = mesh.vertices[corner[0]];
        const Vec3& b = mesh.vertices[corner[1]];
        const Vec3& c = mesh.vertices[corner[2]];
        const auto side = [](const Vec3& p, const Vec3& q, double x, double z) {
            return (q.x - p.x) * (z - p.z) - (q.z - p.z) * (x - p.x);
        };
        const Vec3 from = glm::min(a, glm::min(b, c)) - low;
        const Vec3 to = glm::max(a, glm::max(b, c)) - low;
        for (std::size_t row = cell_of(from.z); row <= std::min(cell_of(to.z), rows - 1); ++row) {
            for (std::size_t column = cell_of(from.x); column <= std::min(cell_of(to.x), columns - 1); ++column) {
                const double x = low.x + kShadowCell * (static_cast<double>(column) + 0.5);
                const double z = low.z + kShadowCell * (static_cast<double>(row) + 0.5);
                const auto [least, most] = std::minmax({side(a, b, x, z), side(b, c, x, z), side(c, a, x, z)});
                if (least >= 0.0 || most <= 0.0) {
                    dark[row * columns + column] = true;
                }
            }
        }
    }
    return kShadowCell * kShadowCell * static_cast<double>(std::count(dark.begin(), dark.end(), true));
}

Drape measure_drape(const SheetTest& test) {
    Drape drape{.mesh = flat_disc()};
    ParticleModel model = sheet_of(drape.mesh, test.material);
    // A polygon of 120 sides is a little smaller than the circle.
    const double flat = shadow_area(drape.mesh);
    for (std::size_t i = 0; i < model.size(); ++i) {
        const Vec3& p = model.rest_position[i];
        const double radius = std::hypot(p.x, p.z);
        const double outside = (radius - Drape::kSupport) / (Drape::kDisc - Drape::kSupport);
        model.pinned[i] = outside < 1e-6 ? 1 : 0;
        if (model.pinned[i] == 0) {
            // Waves of all numbers that folds may have, in different phases.
            const double angle = std::atan2(p.z, p.x);
            for (int waves = 2; waves <= 9; ++waves) {
                model.position[i].y += kRipple * outside * std::cos(waves * angle + waves * waves);
            }
        }
    }
    const Relaxed relaxed = relax(model, {}, relaxation_of(test, kEarth));
    drape.mesh.vertices = model.position;
    const double support = std::numbers::pi * Drape::kSupport * Drape::kSupport;
    drape.coefficient = (shadow_area(drape.mesh) - support) / (flat - support);
    drape.folds = folds_of(drape.mesh);
    drape.simulated_s = relaxed.simulated_s;
    drape.at_rest = relaxed.at_rest;
    return drape;
}

}  // namespace haptic::sim
