#include "collision/ellipsoids.hpp"

#include "simd/ellipsoid_lanes.hpp"
#include "simd/lane_rotation.hpp"

namespace haptic::sim {
namespace {

LaneVec<double> lane(const Vec3& v) noexcept {
    return {v.x, v.y, v.z};
}
LaneSymmetric<double> lane(const EllipsoidShape& s) noexcept {
    return {s.xx, s.yy, s.zz, s.yx, s.zx, s.zy};
}

}  // namespace

EllipsoidShape shape_of(const Vec3& semi_axes, const Quat& turn) noexcept {
    const LaneSymmetric<double> s =
        lane_shape(lane(semi_axes), lane_matrix(LaneQuat<double>{turn.w, turn.x, turn.y, turn.z}));
    return {s.xx, s.yy, s.zz, s.yx, s.zx, s.zy};
}

double reach_of(const EllipsoidShape& shape, const Vec3& normal) noexcept {
    return lane_reach(lane(shape), lane(normal));
}

Vec3 parting_normal(const EllipsoidPassage& passage) noexcept {
    const LaneVec<double> normal = lane_parting_normal(LanePassage<double>{
        lane(passage.first), lane(passage.second), passage.size_ratio, lane(passage.from), lane(passage.to)});
    return {normal.x, normal.y, normal.z};
}

}  // namespace haptic::sim
