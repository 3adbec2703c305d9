#include "dynamics/rotation.hpp"

#include <cmath>
#include <glm/matrix.hpp>

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

void diagonalise(Mat3& m, Mat3& axes, int sweeps) noexcept {
    axes = Mat3(1.0);
    for (int sweep = 0; sweep < sweeps; ++sweep) {
        for (int pair = 0; pair < 3; ++pair) {
            const int p = pair / 2;           // 0, 0, 1
            const int q = pair == 0 ? 1 : 2;  // 1, 2, 2
            if (m[p][q] == 0.0) {
                continue;
            }
            // Rotation in the p-q plane that makes m[p][q] 0; the smaller of both angles.
            const double theta = (m[q][q] - m[p][p]) / (2.0 * m[p][q]);
            const double tangent = (theta < 0.0 ? -1.0 : 1.0) / (std::abs(theta) + std::sqrt(theta * theta + 1.0));
            const double cosine = 1.0 / std::sqrt(tangent * tangent + 1.0);
            Mat3 rotation(1.0);
            rotation[p][p] = rotation[q][q] = cosine;
            rotation[q][p] = cosine * tangent;
            rotation[p][q] = -cosine * tangent;
            // m <- R^T m R; set to 0 what only rounding leaves. The axes accumulate R.
            m = glm::transpose(rotation) * m * rotation;
            m[p][q] = m[q][p] = 0.0;
            axes = axes * rotation;
        }
    }
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
