#include "haptic/sim/organ.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace haptic::sim {
namespace {

constexpr std::uint32_t kMaxOrganRefinements = 5;  // 1.7 million triangles
constexpr std::uint32_t kOrganFrequency = 9;       // divisions of an edge of the icosahedron
constexpr std::uint32_t kSectors = 5;              // of the icosahedron about the x axis

// Cosine and sine of k * 36 degrees, as constants, because the mathematical library differs between machines.
constexpr std::array<double, std::size_t{2} * kSectors> kCosine36{
    1.0,  0.8090169943749475,  0.3090169943749474,  -0.3090169943749474, -0.8090169943749475,
    -1.0, -0.8090169943749475, -0.3090169943749474, 0.3090169943749474,  0.8090169943749475};
constexpr std::array<double, std::size_t{2} * kSectors> kSine36{
    0.0, 0.5877852522924731,  0.9510565162951535,  0.9510565162951535,  0.5877852522924731,
    0.0, -0.5877852522924731, -0.9510565162951535, -0.9510565162951535, -0.5877852522924731};
constexpr double kRingHeight = 0.4472135954999579;  // 1 / sqrt(5): x of the icosahedron's upper ring
constexpr double kRingRadius = 0.8944271909999159;  // 2 / sqrt(5)

// Stretches the sphere's triangles upward along its rim, where the thin edge of the organ flattens them.
constexpr double kSpread = 2.0;

Vec3 unit(const Vec3& v) {
    return v / std::sqrt(glm::dot(v, v));
}

/// Smooth step from 0 to 1 about q = 0; from 0.15 to 0.85 within a unit to either side.
double rise(double q) {
    return 0.5 + 0.5 * q / std::sqrt(1.0 + q * q);
}

/// Smooth bump of height 1 about q = 0; a quarter at q = 1.
double bump(double q) {
    const double square = 1.0 + q * q;
    return 1.0 / (square * square);
}

/// Moves a point of the unit sphere to the organ, whose half length is 1. Each step scales or shifts one coordinate by
/// functions of the others, or of itself in a strictly increasing way, so the whole is invertible.
Vec3 organ_point(const Vec3& p) {
    const double left = rise((p.x - 0.15) / 0.4);     // 0 in the thick lobe, 1 in the thin one
    const double fissure = bump((p.x - 0.3) / 0.24);  // between the lobes
    const double front = 0.25 * (1.0 + p.z) * (1.0 + p.z);
    // Fuller than a sphere at the end of the thick lobe, which is blunt.
    const double blunt = left + (1.0 - left) * std::sqrt(1.0 + p.x * p.x);

    // Outline seen from above: the thin lobe is narrower and farther back, and a notch separates the lobes in front.
    const double width = blunt * (0.70 - 0.24 * left) * (1.0 - 0.26 * fissure * front);
    const double z = width * p.z + 0.018 - 0.16 * left;

    // Thickness: blunt behind and in the thick lobe, sharp in front and in the thin one; a groove along the fissure.
    const double thickness = blunt * (0.44 - 0.26 * left) * (1.0 - 0.40 * p.z) * (1.0 - 0.12 * fissure);
    // The underside is flatter than the dome, and the body arches over a hollow.
    const double arch = 0.18 * p.x * p.x + 0.24 * p.z * p.z;
    const double y = thickness * p.y * (0.70 + 0.30 * p.y) - arch;
    return {p.x, y - 0.033, z};
}

/// Corner of the icosahedron on the ring about +x (`side` 1) or -x (`side` -1), whose corners are turned by 36 degrees.
Vec3 ring_corner(double side, std::size_t sector) {
    const std::size_t angle = (2 * sector + (side < 0.0 ? 1 : 0)) % kCosine36.size();
    return {side * kRingHeight, kRingRadius * kCosine36[angle], kRingRadius * kSine36[angle]};
}

/// Sphere made of an icosahedron (poles on the x axis) whose edges are divided into `n` parts. Its vertices form rows
/// from +x to -x; a row has five sectors with equally many cells.
class GeodesicSphere {
  public:
    explicit GeodesicSphere(std::uint32_t n) : n_(n) {
        mesh_.closed = true;
        for (std::uint32_t row = 0; row <= 3 * n_; ++row) {
            first_.push_back(static_cast<std::uint32_t>(mesh_.vertices.size()));
            add_vertices(row);
        }
        for (std::uint32_t row = 0; row < 3 * n_; ++row) {
            add_triangles(row);
        }
    }

    [[nodiscard]] TriangleMesh take() { return std::move(mesh_); }

  private:
    [[nodiscard]] std::uint32_t cells(std::uint32_t row) const { return std::min({row, n_, 3 * n_ - row}); }

    /// Index of a vertex; the sector's last column is the first one of the next sector.
    [[nodiscard]] std::uint32_t index(std::uint32_t row, std::uint32_t sector, std::uint32_t column) const {
        const std::uint32_t around = std::max(kSectors * cells(row), 1U);
        return first_[row] + (sector * cells(row) + column) % around;
    }

    /// Point of the icosahedron's face, by its barycentric coordinates times n.
    [[nodiscard]] Vec3 flat_point(std::uint32_t row, std::uint32_t sector, std::uint32_t column) const {
        const double n = n_;
        const double c = column;
        const double side = row <= n_ ? 1.0 : -1.0;
        if (row <= n_ || row >= 2 * n_) {
            // Between a pole and its ring.
            const double m = cells(row);
            return (n - m) * Vec3(side, 0.0, 0.0) + (m - c) * ring_corner(side, sector) +
                   c * ring_corner(side, sector + 1);
        }
        // Between the rings: a face with two corners above, then one with two corners below.
        const double below = row - n_;
        const double above = n - below;
        if (c <= above) {
            return (above - c) * ring_corner(1.0, sector) + c * ring_corner(1.0, sector + 1) +
                   below * ring_corner(-1.0, sector);
        }
        return above * ring_corner(1.0, sector + 1) + (n - c) * ring_corner(-1.0, sector) +
               (c - above) * ring_corner(-1.0, sector + 1);
    }

    void add_vertices(std::uint32_t row) {
        if (cells(row) == 0) {
            mesh_.vertices.emplace_back(row == 0 ? 1.0 : -1.0, 0.0, 0.0);
            return;
        }
        for (std::uint32_t sector = 0; sector < kSectors; ++sector) {
            for (std::uint32_t column = 0; column < cells(row); ++column) {
                mesh_.vertices.push_back(unit(flat_point(row, sector, column)));
            }
        }
    }

    /// The strip between a row and the next.
    void add_triangles(std::uint32_t row) {
        const std::uint32_t next = row + 1;
        const bool widens = row < n_;  // about +x the next row has one more cell in each sector
        for (std::uint32_t sector = 0; sector < kSectors; ++sector) {
            for (std::uint32_t c = 0; c < std::max(cells(row), cells(next)); ++c) {
                const std::uint32_t a = index(row, sector, c);
                const std::uint32_t b = index(next, sector, c);
                if (widens) {
                    mesh_.triangles.push_back({a, b, index(next, sector, c + 1)});
                    if (c < cells(row)) {
                        mesh_.triangles.push_back({a, index(next, sector, c + 1), index(row, sector, c + 1)});
                    }
                } else {
                    mesh_.triangles.push_back({a, b, index(row, sector, c + 1)});
                    if (c < cells(next)) {
                        mesh_.triangles.push_back({b, index(next, sector, c + 1), index(row, sector, c + 1)});
                    }
                }
            }
        }
    }

    std::uint32_t n_;
    std::vector<std::uint32_t> first_;  // per row: index of its first vertex
    TriangleMesh mesh_;
};

}  // namespace

void OrganShape::check() const {
    if (!(length > 0.0) || !std::isfinite(length)) {
        throw std::invalid_argument("organ: length must be positive");
    }
    if (refinements > kMaxOrganRefinements) {
        throw std::invalid_argument("organ: refinements must be 0 to " + std::to_string(kMaxOrganRefinements));
    }
}

std::size_t organ_triangles(const OrganShape& shape) noexcept {
    return std::size_t{20} * kOrganFrequency * kOrganFrequency << (2U * shape.refinements);
}

TriangleMesh make_organ_mesh(const OrganShape& shape) {
    shape.check();
    TriangleMesh mesh = GeodesicSphere(kOrganFrequency << shape.refinements).take();
    for (Vec3& vertex : mesh.vertices) {
        vertex = 0.5 * shape.length * organ_point(unit(Vec3(vertex.x, kSpread * vertex.y, vertex.z)));
    }
    return mesh;
}

}  // namespace haptic::sim
