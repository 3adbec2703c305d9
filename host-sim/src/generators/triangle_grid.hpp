// The triangles of a resting mesh in boxes of equal size, for questions about small neighbourhoods.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <haptic/sim/mesh.hpp>
#include <haptic/types.hpp>

namespace haptic::sim {

class TriangleGrid {
  public:
    /// The vertices and triangles must outlive the grid. Boxes are about `cell` wide (m), not more than 96 in a row.
    TriangleGrid(std::span<const Vec3> vertices, std::span<const Triangle> triangles, double cell);

    /// The first crossing of the segment from `from` to `to`, as the part of the way in 0..1; 2 if there is none.
    /// Triangles in whose plane `from` lies, to `on_plane` (m), are left out.
    [[nodiscard]] double first_crossing(const Vec3& from, const Vec3& to, double on_plane) const;

    /// Whether some triangle comes nearer to p than `distance` (m).
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
    std::vector<std::uint32_t> first_;  // per cell and one more, into member_
    std::vector<std::uint32_t> member_;
};

}  // namespace haptic::sim
