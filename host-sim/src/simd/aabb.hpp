// Axis-aligned bounding box (AABB): the one box type of host-sim.
//
// Three box-like types remain beside it, on purpose. PointExtremes and Bounds (simd/refit.hpp,
// simd/collider_rows.hpp) are plain arrays for code that is compiled for registers not every machine has: an inline
// function of this header, compiled there, could be the copy that the linker keeps for all. And verification.cpp, which
// judges the contact code, shares none of its functions.
#pragma once

#include <algorithm>
#include <glm/common.hpp>
#include <limits>
#include <span>

#include "haptic/types.hpp"

namespace haptic::sim {

/// Axis-aligned box. Default: empty, so that it can be extended point by point.
struct Aabb {
    Vec3 min{std::numeric_limits<double>::infinity()};
    Vec3 max{-std::numeric_limits<double>::infinity()};

    void extend(const Vec3& point) noexcept {
        min = glm::min(min, point);
        max = glm::max(max, point);
    }
    void extend(const Aabb& other) noexcept {
        min = glm::min(min, other.min);
        max = glm::max(max, other.max);
    }
    [[nodiscard]] Vec3 size() const noexcept { return max - min; }
    [[nodiscard]] Vec3 center() const noexcept { return 0.5 * (min + max); }
};

/// Whether two boxes have a point in common, their borders included.
[[nodiscard]] inline bool overlaps(const Aabb& a, const Aabb& b) noexcept {
    return a.min.x <= b.max.x && a.max.x >= b.min.x && a.min.y <= b.max.y && a.max.y >= b.min.y && a.min.z <= b.max.z &&
           a.max.z >= b.min.z;
}

/// Whether the inner box lies in the outer one; borders may touch.
[[nodiscard]] inline bool contains(const Aabb& outer, const Aabb& inner) noexcept {
    return outer.min.x <= inner.min.x && outer.min.y <= inner.min.y && outer.min.z <= inner.min.z &&
           outer.max.x >= inner.max.x && outer.max.y >= inner.max.y && outer.max.z >= inner.max.z;
}

/// The box with a margin on all sides.
[[nodiscard]] inline Aabb grown(const Aabb& box, double margin) noexcept {
    return {box.min - Vec3(margin), box.max + Vec3(margin)};
}

/// Box of a set of points; empty for none.
[[nodiscard]] inline Aabb aabb_of(std::span<const Vec3> points) noexcept {
    Aabb box;
    for (const Vec3& point : points) {
        box.extend(point);
    }
    return box;
}

/// Box of a triangle.
[[nodiscard]] inline Aabb aabb_of(const Vec3& a, const Vec3& b, const Vec3& c) noexcept {
    return {glm::min(a, glm::min(b, c)), glm::max(a, glm::max(b, c))};
}

/// Box of the segment from p to q, grown by `margin` on all sides.
[[nodiscard]] inline Aabb aabb_of_segment(const Vec3& p, const Vec3& q, double margin) noexcept {
    Aabb box;
    for (int axis = 0; axis < 3; ++axis) {
        box.min[axis] = std::min(p[axis], q[axis]) - margin;
        box.max[axis] = std::max(p[axis], q[axis]) + margin;
    }
    return box;
}

}  // namespace haptic::sim
