// Vertex welding with a hash grid.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <limits>
#include <span>
#include <vector>

#include "haptic/sim/mesh_check.hpp"

namespace haptic::sim {
namespace {

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
// Cell size in tolerances: large enough that most balls of that radius lie in one cell, small enough that few kept
// vertices, a tolerance apart, fit into one.
constexpr double kCell = 4.0;
// Smallest cell size as a fraction of the largest coordinate, so that cell numbers are exact.
constexpr double kMinCell = 1e-12;

/// Hash grid of the vertices kept so far.
class Grid {
  public:
    Grid(std::span<const Vec3> vertices, double tolerance) : vertices_(vertices), tolerance_(tolerance) {
        double largest = 0.0;
        for (const Vec3& v : vertices) {
            largest = std::max({largest, std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)});
        }
        const double cell = std::max({kCell * tolerance, kMinCell * largest, std::numeric_limits<double>::min()});
        cells_per_m_ = 1.0 / cell;
        first_.assign(std::bit_ceil(2 * vertices.size() + 1), kNone);
        next_.assign(vertices.size(), kNone);
    }

    /// The first kept vertex within the tolerance, or kNone.
    [[nodiscard]] std::uint32_t find(std::uint32_t vertex) const {
        const Vec3& v = vertices_[vertex];
        std::array<std::int64_t, 3> low{};
        std::array<std::int64_t, 3> high{};
        for (int axis = 0; axis < 3; ++axis) {
            const auto i = static_cast<std::size_t>(axis);
            low[i] = cell_of(v[axis] - tolerance_);
            high[i] = cell_of(v[axis] + tolerance_);
        }
        std::uint32_t found = kNone;
        for (std::int64_t x = low[0]; x <= high[0]; ++x) {
            for (std::int64_t y = low[1]; y <= high[1]; ++y) {
                for (std::int64_t z = low[2]; z <= high[2]; ++z) {
                    found = std::min(found, first_in(slot(x, y, z), v));
                }
            }
        }
        return found;
    }

    void keep(std::uint32_t vertex) {
        const Vec3& v = vertices_[vertex];
        std::uint32_t& first = first_[slot(cell_of(v.x), cell_of(v.y), cell_of(v.z))];
        next_[vertex] = first;
        first = vertex;
    }

  private:
    [[nodiscard]] std::int64_t cell_of(double coordinate) const {
        return static_cast<std::int64_t>(std::floor(coordinate * cells_per_m_));
    }

    /// Hash of a cell. Cells that share a slot cost time only, because distances decide.
    [[nodiscard]] std::size_t slot(std::int64_t x, std::int64_t y, std::int64_t z) const {
        std::uint64_t hash = 0;
        for (const std::int64_t n : {x, y, z}) {
            hash = (hash ^ static_cast<std::uint64_t>(n)) * 0x9E3779B97F4A7C15U;
            hash ^= hash >> 29U;
        }
        return static_cast<std::size_t>(hash) & (first_.size() - 1);
    }

    [[nodiscard]] std::uint32_t first_in(std::size_t slot, const Vec3& v) const {
        std::uint32_t found = kNone;
        for (std::uint32_t other = first_[slot]; other != kNone; other = next_[other]) {
            const Vec3 separation = vertices_[other] - v;
            if (tolerance_ > 0.0 ? glm::dot(separation, separation) <= tolerance_ * tolerance_
                                 : vertices_[other] == v) {
                found = std::min(found, other);
            }
        }
        return found;
    }

    std::span<const Vec3> vertices_;
    double tolerance_;
    double cells_per_m_ = 1.0;
    std::vector<std::uint32_t> first_;  // [slot], newest vertex in it
    std::vector<std::uint32_t> next_;   // [vertex], the previous one in its slot
};

}  // namespace

std::vector<std::uint32_t> weld(std::span<const Vec3> vertices, double tolerance) {
    Grid grid(vertices, tolerance);
    std::vector<std::uint32_t> representative(vertices.size());
    for (std::uint32_t i = 0; i < vertices.size(); ++i) {
        const std::uint32_t found = grid.find(i);
        representative[i] = found == kNone ? i : found;
        if (found == kNone) {
            grid.keep(i);
        }
    }
    return representative;
}

}  // namespace haptic::sim
