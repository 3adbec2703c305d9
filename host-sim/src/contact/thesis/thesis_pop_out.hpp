// Algorithm 2 of the thesis: proxy pop-out as printed (section 4.2.4), for comparison with pop_out.hpp.
//
// The print leaves details open. Here a triangle is penetrated if it is nearer than shrink * radius (4.1.4). A pop
// moves the centre to the full radius from the closest point, by at least the minimum of section 4.4.2. A centre
// exactly on a triangle pops along the triangle's normal. Triangles are visited in the order of objects, then of their
// triangles. The result depends on this order, may be on the wrong side and may not be clear: section 4.6.1 of the
// thesis.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "contact/pop_out.hpp"
#include "contact/proxy_path.hpp"
#include "contact/swept_tree.hpp"
#include "haptic/sim/contact.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// A triangle of the in_range_triangle_list of Algorithm 2, at the end of the step, prepared for repeated closest-point
/// queries.
struct InRangeTriangle {
    struct Edge {
        Vec3 from{0.0};
        Vec3 along{0.0};  // unit; zero for an edge of zero length
        double length = 0.0;
        Vec3 outward{0.0};  // in the triangle's plane, not normalised; zero for a degenerate triangle
    };
    Vec3 normal{0.0};  // unit, by the order of the corners; zero for a degenerate triangle
    std::array<Edge, 3> edges;
};

/// Prepares a triangle.
[[nodiscard]] InRangeTriangle in_range_triangle(const TriangleCorners& triangle) noexcept;

/// Capacity of the list for one proxy; the nearest triangles are kept. Tens are usual.
inline constexpr std::size_t kMaxInRange = 256;

/// Result of lines 6 to 15.
struct ListPopOut {
    Vec3 position{0.0};
    int iterations = 0;     // passes over the list that found a penetration
    bool clear = true;      // false: stopped at pop_out_limit
    std::int64_t pops = 0;  // penetrations resolved in all passes
};

/// Lines 6 to 15: repeated passes over the list. Each penetrated triangle is popped out of at once, until a pass finds
/// none.
[[nodiscard]] ListPopOut pop_out_of_list(std::span<const InRangeTriangle> triangles, const Vec3& center, double radius,
                                         const ContactSettings& settings, ProxyPath* path = nullptr) noexcept;

/// Complete Algorithm 2. `clearance` and `overconstrained` refer to the final position among all surfaces, not only
/// those in the list. Appends the path of the centre to `path`: the first pops one by one, the rest as one straight
/// line.
[[nodiscard]] PopOut thesis_pop_out(std::span<const MovingSurface> surfaces, const Vec3& center, double radius,
                                    const ContactSettings& settings, ProxyPath* path = nullptr) noexcept;

}  // namespace haptic::sim
