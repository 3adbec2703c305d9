// One lane: the vectors and quaternions of single numbers, to and from those of lanes.
#pragma once

#include "haptic/types.hpp"
#include "simd/lanes.hpp"

namespace haptic::sim {

[[nodiscard]] inline LaneVec<double> lane(const Vec3& v) noexcept {
    return {v.x, v.y, v.z};
}
[[nodiscard]] inline LaneQuat<double> lane(const Quat& q) noexcept {
    return {q.w, q.x, q.y, q.z};
}
[[nodiscard]] inline Vec3 plain(const LaneVec<double>& v) noexcept {
    return {v.x, v.y, v.z};
}
[[nodiscard]] inline Quat plain(const LaneQuat<double>& q) noexcept {
    return Quat(q.w, q.x, q.y, q.z);
}

}  // namespace haptic::sim
