#include "device/kinematics.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "haptic/numeric.hpp"

namespace haptic::rt {
namespace {

// Limits of one Gauss-Newton step: far more than a hand moves in a millisecond, and small enough for the linearisation
// of the lengths to hold.
constexpr double kMaxTranslationStep = 0.05;  // m
constexpr double kMaxRotationStep = 0.5;      // rad

// Smallest pivot of the scaled normal matrix that counts as full rank. Its eigenvalues at the centre of an X3R are 0.75
// to 3.9; at 1e-3 one encoder count (17 um) moves the pose by half a millimetre.
constexpr double kMinPivot = 1e-3;

// m. A string of zero length has no direction; dividing its zero span by this gives a zero row.
constexpr double kMinLength = 1e-100;

using Mat6 = std::array<Vec6, 6>;

/// Dot product as two partial sums, which the compiler keeps in one SIMD register.
double dot(const StringArray& a, const StringArray& b) HAPTIC_RT {
    double even = 0.0;
    double odd = 0.0;
    for (std::size_t i = 0; i < kStrings; i += 2) {
        even += a[i] * b[i];
        odd += a[i + 1] * b[i + 1];
    }
    return even + odd;
}

/// Solves m x = b by the factorisation m = L D L^T, x in place of b. Of the symmetric m the lower triangle is read and
/// overwritten. False if a pivot is below kMinPivot.
bool solve_symmetric(Mat6& m, Vec6& b) HAPTIC_RT {
    // Factorisation, with the forward substitution of b in the same pass.
    Vec6 inverse{};
    for (std::size_t column = 0; column < 6; ++column) {
        const double pivot = m[column][column];
        if (!(pivot > kMinPivot)) {  // true for NaN
            return false;
        }
        inverse[column] = 1.0 / pivot;
        for (std::size_t row = column + 1; row < 6; ++row) {
            // Row update: m_rk -= L_rc D_c L_kc, and the same for b. The entry (row, column) keeps L_rc D_c.
            const double factor = m[row][column] * inverse[column];
            for (std::size_t k = column + 1; k <= row; ++k) {
                m[row][k] -= factor * m[k][column];
            }
            b[row] -= factor * b[column];
        }
    }
    // Back substitution.
    for (std::size_t row = 6; row-- > 0;) {
        // x_r = (b_r - sum m_kr x_k) / D_r with k > r.
        double value = b[row];
        for (std::size_t k = row + 1; k < 6; ++k) {
            value -= m[k][row] * b[k];
        }
        b[row] = value * inverse[row];
    }
    return true;
}

Vec3 clamped_length(const Vec3& step, double longest) HAPTIC_RT {
    const double length = std::sqrt(glm::dot(step, step));
    return length > longest ? step * (longest / length) : step;
}

/// Rotates by a small rotation vector v, device frame. The unnormalised quaternion (1, v/2) rotates by 2 atan(|v|/2),
/// which equals |v| to third order: as good a Gauss-Newton step as the exact rotation, and always below pi.
Quat rotated(const Quat& orientation, const Vec3& rotation) HAPTIC_RT {
    const Vec3 half = 0.5 * rotation;
    const Quat product = Quat(1.0, half.x, half.y, half.z) * orientation;
    return product * (1.0 / std::sqrt(glm::dot(product, product)));
}

struct StringState {
    Vec3 moment_arm;  // m, r_i: from the grip's origin to the knot, device frame
    Vec3 direction;   // unit, u_i: from knot to motor; zero for a string of zero length
    double length;    // m, l_i
};

StringState string_state(const device::StringFacts& string, const Mat3& rotation, const Vec3& position) HAPTIC_RT {
    const Vec3 arm = rotation * string.grip;
    const Vec3 span = string.motor - (position + arm);
    const double length = std::sqrt(glm::dot(span, span));
    return {arm, length > 0.0 ? span * (1.0 / length) : Vec3{0.0, 0.0, 0.0}, length};
}

}  // namespace

StringArray string_lengths(const device::DeviceGeometry& geometry, const Pose& device_from_grip) HAPTIC_RT {
    const Mat3 rotation = glm::mat3_cast(device_from_grip.orientation);
    StringArray lengths{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        lengths[i] = string_state(geometry.strings[i], rotation, device_from_grip.position).length;
    }
    return lengths;
}

WireMatrix wire_matrix(const device::DeviceGeometry& geometry, const Pose& device_from_grip) HAPTIC_RT {
    const Mat3 rotation = glm::mat3_cast(device_from_grip.orientation);
    WireMatrix wires{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        const StringState state = string_state(geometry.strings[i], rotation, device_from_grip.position);
        // Row i of A: [u_i, r_i x u_i].
        const Vec3 moment = glm::cross(state.moment_arm, state.direction);
        wires[i] = {state.direction.x, state.direction.y, state.direction.z, moment.x, moment.y, moment.z};
    }
    return wires;
}

Wrench wrench_of_tensions(const WireMatrix& wires, const StringArray& tensions) HAPTIC_RT {
    Wrench wrench;
    for (std::size_t i = 0; i < kStrings; ++i) {
        const Vec6& row = wires[i];
        wrench.force += tensions[i] * Vec3(row[0], row[1], row[2]);
        wrench.torque += tensions[i] * Vec3(row[3], row[4], row[5]);
    }
    return wrench;
}

PoseSolver::PoseSolver(const device::DeviceGeometry& geometry) : geometry_(geometry) {
    // Radius of the grip (farthest knot), and reach of the device (farthest motor).
    double radius = 0.0;
    for (const device::StringFacts& string : geometry.strings) {
        radius = std::max(radius, glm::length(string.grip));
        reach_ = std::max(reach_, glm::length(string.motor));
    }
    if (!(radius > 0.0) || !std::isfinite(radius) || !(reach_ > 0.0) || !std::isfinite(reach_)) {
        throw std::invalid_argument("pose solver: device geometry '" + geometry.name +
                                    "' needs finite motor and knot positions away from the origin");
    }
    // Rotations are solved for in metres at the grip's radius, so that all columns of A have entries of about 1.
    rotation_scale_ = 1.0 / radius;
    for (std::size_t i = 0; i < kStrings; ++i) {
        for (std::size_t k = 0; k < 3; ++k) {
            const auto component = static_cast<Vec3::length_type>(k);
            // Structure of arrays, for the vectorised loop of gauss_newton_step().
            motor_[k][i] = geometry.strings[i].motor[component];
            grip_[k][i] = geometry.strings[i].grip[component];
        }
    }
}

void PoseSolver::reset(const Pose& pose) HAPTIC_RT {
    const Quat& q = pose.orientation;
    const double squared = glm::dot(q, q);
    estimate_ = PoseEstimate{};
    if (is_finite(pose.position) && std::isfinite(squared) && squared > 0.0) {
        estimate_.pose = {clamped_length(pose.position, reach_), q * (1.0 / std::sqrt(squared))};
    }
}

PoseStatus PoseSolver::gauss_newton_step(const StringArray& lengths, std::size_t without, Pose& pose) const HAPTIC_RT {
    const Mat3 r = glm::mat3_cast(pose.orientation);
    const Vec3 p = pose.position;
    // Columns of A = [u, r x u] with rotations scaled, and length errors l(pose) - l. One lane a string and no
    // branches, so that the compiler vectorises over strings.
    std::array<StringArray, 6> columns{};
    StringArray error{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        const double bx = grip_[0][i];
        const double by = grip_[1][i];
        const double bz = grip_[2][i];
        // r = R b, w = a - p - r, u = w / |w|.
        const double arm_x = r[0][0] * bx + r[1][0] * by + r[2][0] * bz;
        const double arm_y = r[0][1] * bx + r[1][1] * by + r[2][1] * bz;
        const double arm_z = r[0][2] * bx + r[1][2] * by + r[2][2] * bz;
        const double span_x = motor_[0][i] - p.x - arm_x;
        const double span_y = motor_[1][i] - p.y - arm_y;
        const double span_z = motor_[2][i] - p.z - arm_z;
        // Length l_i of the string and its direction u_i.
        const double length = std::sqrt(span_x * span_x + span_y * span_y + span_z * span_z);
        const double inverse = 1.0 / std::max(length, kMinLength);
        const double ux = span_x * inverse;
        const double uy = span_y * inverse;
        const double uz = span_z * inverse;
        // Row i: [u, r x u / radius].
        columns[0][i] = ux;
        columns[1][i] = uy;
        columns[2][i] = uz;
        columns[3][i] = (arm_y * uz - arm_z * uy) * rotation_scale_;
        columns[4][i] = (arm_z * ux - arm_x * uz) * rotation_scale_;
        columns[5][i] = (arm_x * uy - arm_y * ux) * rotation_scale_;
        error[i] = length - lengths[i];  // sign of dl = -A dx
    }
    // A zero row takes a string out of the least squares.
    if (without < kStrings) {
        for (StringArray& column : columns) {
            column[without] = 0.0;
        }
    }
    // Normal equations A^T A dx = A^T error.
    Mat6 normal{};
    Vec6 step{};
    for (std::size_t j = 0; j < 6; ++j) {
        step[j] = dot(columns[j], error);
        for (std::size_t k = 0; k <= j; ++k) {
            normal[j][k] = dot(columns[j], columns[k]);
        }
    }
    // No full rank: this pose or set of strings does not determine six degrees of freedom.
    if (!solve_symmetric(normal, step)) {
        return PoseStatus::RankDeficient;
    }
    // Limited step, back in radians; the position stays within reach.
    const Vec3 translation = clamped_length({step[0], step[1], step[2]}, kMaxTranslationStep);
    const Vec3 rotation = clamped_length(Vec3(step[3], step[4], step[5]) * rotation_scale_, kMaxRotationStep);
    if (!is_finite(translation) || !is_finite(rotation)) {
        return PoseStatus::NonFinite;
    }
    pose.position = clamped_length(pose.position + translation, reach_);
    pose.orientation = rotated(pose.orientation, rotation);
    return PoseStatus::Ok;
}

PoseEstimate PoseSolver::solve_from(const Pose& start, const StringArray& lengths,
                                    std::size_t without) const HAPTIC_RT {
    PoseEstimate next{start, 0.0, PoseStatus::Ok, {}};
    // Non-finite lengths stop the solver before they reach the pose.
    for (const double length : lengths) {
        if (!std::isfinite(length)) {
            next.status = PoseStatus::NonFinite;
        }
    }
    // Fixed number of Gauss-Newton steps: the run time does not depend on the data.
    for (int iteration = 0; iteration < kIterations && next.status == PoseStatus::Ok; ++iteration) {
        next.status = gauss_newton_step(lengths, without, next.pose);
    }
    if (next.status == PoseStatus::Ok) {
        // Residuals at the solution: measured minus explained lengths.
        const StringArray explained = string_lengths(geometry_, next.pose);
        double sum = 0.0;
        for (std::size_t i = 0; i < kStrings; ++i) {
            next.residuals[i] = lengths[i] - explained[i];
            sum += i == without ? 0.0 : next.residuals[i] * next.residuals[i];
        }
        // Root mean square. A string that is left out adds nothing; the divisor stays the same, for comparison.
        next.residual = std::sqrt(sum / static_cast<double>(kStrings));
        if (!std::isfinite(next.residual)) {
            next.status = PoseStatus::NonFinite;
        }
    }
    // On failure the pose stays at the start.
    return next.status == PoseStatus::Ok ? next : PoseEstimate{start, 0.0, next.status, {}};
}

const PoseEstimate& PoseSolver::solve(const StringArray& lengths) HAPTIC_RT {
    const PoseEstimate next = solve_from(estimate_.pose, lengths, kNone);
    if (next.status == PoseStatus::Ok) {
        estimate_ = next;
    } else {
        estimate_.status = next.status;
    }
    return estimate_;
}

PoseEstimate PoseSolver::solve_without(std::size_t without, const StringArray& lengths,
                                       const Pose& start) const HAPTIC_RT {
    return solve_from(start, lengths, without);
}

}  // namespace haptic::rt
