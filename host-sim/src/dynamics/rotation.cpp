#include "dynamics/rotation.hpp"

#include "dynamics/one_lane.hpp"
#include "simd/lane_rotation.hpp"

namespace haptic::sim {

Mat3 to_matrix(const Quat& q) noexcept {
    const LaneMat<double> m = lane_matrix(lane(q));
    return Mat3(plain(m.x), plain(m.y), plain(m.z));
}

Quat turned(const Quat& q, const Vec3& rotation) noexcept {
    return plain(lane_rotated(lane(q), lane(rotation)));
}

Vec3 rotation_between(const Quat& from, const Quat& to) noexcept {
    return plain(lane_rotation_between(lane(from), lane(to)));
}

Quat extract_rotation(const Mat3& matrix, const Quat& guess, int iterations) noexcept {
    const LaneMat<double> m{lane(matrix[0]), lane(matrix[1]), lane(matrix[2])};
    return plain(lane_extract_rotation(m, lane(guess), iterations));
}

Vec3 solve_inertia(const Mat3& scatter, const Vec3& momentum) noexcept {
    const LaneSymmetric<double> lower{.xx = scatter[0][0],
                                      .yy = scatter[1][1],
                                      .zz = scatter[2][2],
                                      .yx = scatter[1][0],
                                      .zx = scatter[2][0],
                                      .zy = scatter[2][1]};
    return plain(lane(momentum) / lane_inertia(lower));
}

}  // namespace haptic::sim
