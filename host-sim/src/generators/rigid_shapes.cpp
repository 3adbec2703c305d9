#include "haptic/sim/rigid_shapes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

#include "simd/aabb.hpp"

namespace haptic::sim {
namespace {

constexpr std::uint32_t kMaxCells = 256;
constexpr std::uint32_t kRodSides = 12;
constexpr double kHalfRootOfThree = 0.86602540378443865;
// Cosines of k * 30 degrees; the sine is entry k - 3.
constexpr std::array<double, kRodSides> kRodCosine{1.0,  kHalfRootOfThree,  0.5,  0.0, -0.5, -kHalfRootOfThree,
                                                   -1.0, -kHalfRootOfThree, -0.5, 0.0, 0.5,  kHalfRootOfThree};

void require_size(double size, const char* what) {
    if (!(size > 0.0) || !std::isfinite(size)) {
        throw std::invalid_argument(std::string(what) + " must be positive");
    }
}

}  // namespace

void PlateShape::check() const {
    if (cells < 1 || cells > kMaxCells) {
        throw std::invalid_argument("plate: cells must be 1 to " + std::to_string(kMaxCells));
    }
    for (int k = 0; k < 3; ++k) {
        require_size(size[k], "plate: each size");
    }
}

void RodShape::check() const {
    require_size(length, "rod: length");
    require_size(diameter, "rod: diameter");
}

std::size_t plate_triangles(const PlateShape& shape) noexcept {
    return 4 * std::size_t{shape.cells} * (shape.cells + std::size_t{2});
}

std::size_t rod_triangles() noexcept {
    return 2 * kRodSides + 2 * (kRodSides - 2);
}

TriangleMesh make_plate_mesh(const PlateShape& shape) {
    shape.check();
    const std::uint32_t n = shape.cells;
    const std::uint32_t below = (n + 1) * (n + 1);  // index of the first vertex of the lower face
    TriangleMesh mesh;
    mesh.closed = true;
    mesh.vertices.reserve(2 * std::size_t{below});
    for (const double y : {0.5, -0.5}) {
        for (std::uint32_t j = 0; j <= n; ++j) {
            for (std::uint32_t i = 0; i <= n; ++i) {
                mesh.vertices.push_back(shape.size *
                                        Vec3(static_cast<double>(i) / n - 0.5, y, static_cast<double>(j) / n - 0.5));
            }
        }
    }
    mesh.triangles.reserve(plate_triangles(shape));
    for (std::uint32_t j = 0; j < n; ++j) {
        for (std::uint32_t i = 0; i < n; ++i) {
            const std::uint32_t a = j * (n + 1) + i;
            const std::uint32_t c = a + n + 1;
            mesh.triangles.push_back({a, c, c + 1});
            mesh.triangles.push_back({a, c + 1, a + 1});
            mesh.triangles.push_back({below + a, below + c + 1, below + c});
            mesh.triangles.push_back({below + a, below + a + 1, below + c + 1});
        }
    }
    // Side wall under the border edge from a to b, counter-clockwise seen from above.
    const auto wall = [&](std::uint32_t a, std::uint32_t b) {
        mesh.triangles.push_back({a, below + a, below + b});
        mesh.triangles.push_back({a, below + b, b});
    };
    for (std::uint32_t k = 0; k < n; ++k) {
        wall(n * (n + 1) + k, n * (n + 1) + k + 1);    // +z
        wall(k + 1, k);                                // -z
        wall((k + 1) * (n + 1) + n, k * (n + 1) + n);  // +x
        wall(k * (n + 1), (k + 1) * (n + 1));          // -x
    }
    return mesh;
}

TriangleMesh make_rod_mesh(const RodShape& shape) {
    shape.check();
    TriangleMesh mesh;
    mesh.closed = true;
    const double radius = 0.5 * shape.diameter;
    for (const double x : {-0.5, 0.5}) {
        for (std::uint32_t k = 0; k < kRodSides; ++k) {
            mesh.vertices.emplace_back(x * shape.length, radius * kRodCosine[k],
                                       radius * kRodCosine[(k + kRodSides - 3) % kRodSides]);
        }
    }
    mesh.triangles.reserve(rod_triangles());
    for (std::uint32_t k = 0; k < kRodSides; ++k) {
        const std::uint32_t next = (k + 1) % kRodSides;
        mesh.triangles.push_back({k, kRodSides + next, kRodSides + k});
        mesh.triangles.push_back({k, next, kRodSides + next});
    }
    for (std::uint32_t k = 1; k + 1 < kRodSides; ++k) {
        mesh.triangles.push_back({0, k + 1, k});
        mesh.triangles.push_back({kRodSides, kRodSides + k, kRodSides + k + 1});
    }
    return mesh;
}

ParticleModel make_rigid_particles(const TriangleMesh& mesh, double mass) {
    const Vec3 size = aabb_of(mesh.vertices).size();
    const auto count = static_cast<double>(mesh.vertices.size());
    // Unused by pinned particles: of the order of the spacing.
    const double radius = 0.5 * std::max({size.x, size.y, size.z}) / std::sqrt(count);
    ParticleModel model;
    for (const Vec3& p : mesh.vertices) {
        model.add(p, mass / count, radius);
        model.pinned.back() = 1;
    }
    return model;
}

}  // namespace haptic::sim
