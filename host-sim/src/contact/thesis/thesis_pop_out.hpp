// Proxy pop-out as the thesis prints it (section 4.2.4, Algorithm 2), to be compared with pop_out.hpp.
//
// What the print leaves open is settled so: a triangle is penetrated when it is nearer than shrink * radius (4.1.4);
// the pop then leads to the full radius from the nearest point, by at least the minimum of section 4.4.2; a centre
// right on a triangle is popped along the triangle's normal. The order of triangles is that of the objects and of their
// triangles. The result depends on it, may be on the wrong side and may not be clear: section 4.6.1 of the thesis.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include <haptic/sim/contact.hpp>
#include "contact/pop_out.hpp"
#include "contact/proxy_path.hpp"
#include "contact/swept_tree.hpp"
#include <haptic/types.hpp>

namespace haptic::sim {

/// A triangle of Algorithm 2's in_range_triangle_list, as it is at the end of the step, made ready for being asked for
/// its nearest point again and again.
struct InRangeTriangle {
    struct Edge {
        Vec3 from{0.0};
        Vec3 along{0.0};  // unit; zero for an edge without length
        double length = 0.0;
        Vec3 outward{0.0};  // in the triangle's plane, any length; zero for a degenerate triangle
    };
    Vec3 normal{0.0};  // unit, by the order of the corners; zero for a degenerate triangle
    std::array<Edge, 3> edges;
};

[[nodiscard]] InRangeTriangle in_range_triangle(const TriangleCorners& triangle) noexcept;

/// More triangles than this near one proxy are not looked at; the nearest ones are. Tens are usual.
inline constexpr std::size_t kMaxInRange = 256;

struct PoppedThrough {
    Vec3 position{0.0};
    int iterations = 0;     // passes over the list in which something was penetrated
    bool clear = true;      // false: pop_out_limit was met first
    std::int64_t pops = 0;  // penetrations resolved, of all passes
};

/// Lines 6 to 15: pass after pass over the list, each penetrated triangle popped out of at once, until a pass finds
/// none.
[[nodiscard]] PoppedThrough pop_through(std::span<const InRangeTriangle> triangles, const Vec3& center, double radius,
                                        const ContactSettings& settings, ProxyPath* path = nullptr) noexcept;

/// All of Algorithm 2. `clearance` and `squeezed` of the result are those of the place where it ends, among all
/// surfaces and not only those in the list. Appends the way of the centre to `path`, the first pops one by one, the
/// rest of a long quarrel in one line.
[[nodiscard]] PopOut thesis_pop_out(std::span<const MovingSurface> surfaces, const Vec3& center, double radius,
                                    const ContactSettings& settings, ProxyPath* path = nullptr) noexcept;

}  // namespace haptic::sim
