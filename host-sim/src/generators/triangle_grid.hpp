// Uniform grid over the triangles of a resting mesh, for queries about small neighbourhoods.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "haptic/sim/mesh.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

class TriangleGrid {
  public:
    /// Vertices and triangles must outlive the grid. Cells are about `cell` wide, m; at most 96 along an axis.
    TriangleGrid(std::span<const Vec3> vertices, std::span<const Triangle> triangles, double cell);

    /// Parameter in 0..1 of the first crossing along the segment from `from` to `to`; 2 if there is none. Ignores
    /// triangles whose plane is within `on_plane`, m, of `from`.
    [[nodiscard]] double first_crossing(const Vec3& from, const Vec3& to, double on_plane) const;

    /// Whether a triangle is nearer to p than `distance`, m.
    [[nodiscard]] bool near(const Vec3& p, double distance) const;

  private:
    struct Cells {
        std::array<std::size_t, 3> low;
        std::array<std::size_t, 3> high;
    };
    [[nodiscard]] Cells cells_of(const Vec3& low, const Vec3& high) const;
    template <typename Visitor>
    void visit(const Vec3& low, const Vec3& high, Visitor&& visitor) const;

    std::span<const Vec3> vertices_;
    std::span<const Triangle> triangles_;
    Vec3 low_{0.0};
    Vec3 cells_per_metre_{0.0};
    std::array<std::size_t, 3> count_{};
    std::vector<std::uint32_t> first_;   // [cell + 1], index into member_
    std::vector<std::uint32_t> member_;  // triangles, cell by cell
};

}  // namespace haptic::sim
