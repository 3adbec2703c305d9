#include "collision/ellipsoids.hpp"

#include "dynamics/one_lane.hpp"
#include "simd/ellipsoid_lanes.hpp"
#include "simd/lane_rotation.hpp"

namespace haptic::sim {
namespace {

LaneSymmetric<double> lane(const EllipsoidShape& s) noexcept {
    return {s.xx, s.yy, s.zz, s.yx, s.zx, s.zy};
}

}  // namespace

EllipsoidShape shape_of(const Vec3& semi_axes, const Quat& orientation) noexcept {
    const LaneSymmetric<double> s = lane_shape(
        lane(semi_axes), lane_matrix(LaneQuat<double>{orientation.w, orientation.x, orientation.y, orientation.z}));
    return {s.xx, s.yy, s.zz, s.yx, s.zx, s.zy};
}

double reach_of(const EllipsoidShape& shape, const Vec3& normal) noexcept {
    return lane_reach(lane(shape), lane(normal));
}

Vec3 separating_normal(const EllipsoidSweep& sweep) noexcept {
    const LaneVec<double> normal = lane_separating_normal(
        LaneSweep<double>{lane(sweep.first), lane(sweep.second), sweep.size_ratio, lane(sweep.from), lane(sweep.to)});
    return {normal.x, normal.y, normal.z};
}

}  // namespace haptic::sim
