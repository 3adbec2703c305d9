#include "device/kinematics.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace haptic::rt {
namespace {

// Steps of one Gauss-Newton iteration are cut to these: far more than a hand moves in a millisecond, and little enough
// that the linearised lengths still mean something.
constexpr double kLongestStep = 0.05;  // m
constexpr double kWidestStep = 0.5;    // rad

// The smallest pivot of the scaled normal matrix that still counts as full rank. Its eigenvalues are 0.75 to 3.9 at the
// centre of an X3R; at 1e-3 an encoder count (17 um) already shows as half a millimetre.
constexpr double kSmallestPivot = 1e-3;

// m. A string of no length has no direction: its span of zero over this gives a row of zeros.
constexpr double kLeastLength = 1e-100;

using Mat6 = std::array<Vec6, 6>;

bool is_finite(const Vec3& v) HAPTIC_RT {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

/// Two sums side by side, which the compiler keeps in one register.
double dot(const StringArray& a, const StringArray& b) HAPTIC_RT {
    double even = 0.0;
    double odd = 0.0;
    for (std::size_t i = 0; i < kStrings; i += 2) {
        even += a[i] * b[i];
        odd += a[i + 1] * b[i + 1];
    }
    return even + odd;
}

/// Solves m x = b in place of b for a symmetric m, of which the lower triangle is read and overwritten, as L D L^T: no
/// square roots. False if a pivot is too small.
bool solve_symmetric(Mat6& m, Vec6& b) HAPTIC_RT {
    Vec6 inverse{};
    for (std::size_t column = 0; column < 6; ++column) {
        const double pivot = m[column][column];
        if (!(pivot > kSmallestPivot)) {  // also when it is not a number
            return false;
        }
        inverse[column] = 1.0 / pivot;
        for (std::size_t row = column + 1; row < 6; ++row) {
            const double factor = m[row][column] * inverse[column];
            for (std::size_t k = column + 1; k <= row; ++k) {
                m[row][k] -= factor * m[k][column];
            }
            b[row] -= factor * b[column];
        }
    }
    for (std::size_t row = 6; row-- > 0;) {
        double value = b[row];
        for (std::size_t k = row + 1; k < 6; ++k) {
            value -= m[k][row] * b[k];
        }
        b[row] = value * inverse[row];
    }
    return true;
}

Vec3 shortened(const Vec3& step, double longest) HAPTIC_RT {
    const double length = std::sqrt(glm::dot(step, step));
    return length > longest ? step * (longest / length) : step;
}

/// Turns by a small rotation vector, device frame. The unnormalised quaternion (1, v/2) turns by 2 atan(|v|/2), which
/// is |v| to third order: as good a step for Gauss-Newton as the exact one, and never further than half a turn.
Quat turned(const Quat& orientation, const Vec3& rotation) HAPTIC_RT {
    const Vec3 half = 0.5 * rotation;
    const Quat product = Quat(1.0, half.x, half.y, half.z) * orientation;
    return product * (1.0 / std::sqrt(glm::dot(product, product)));
}

struct StringState {
    Vec3 arm;        // m, from the grip's origin to the knot, device frame
    Vec3 direction;  // unit, from knot to motor; zero for a string of no length
    double length;   // m
};

StringState string_state(const device::StringFacts& string, const Mat3& rotation, const Vec3& position) HAPTIC_RT {
    const Vec3 arm = rotation * string.grip;
    const Vec3 span = string.motor - (position + arm);
    const double length = std::sqrt(glm::dot(span, span));
    return {arm, length > 0.0 ? span * (1.0 / length) : Vec3{0.0, 0.0, 0.0}, length};
}

}  // namespace

StringArray string_lengths(const device::Variant& variant, const Pose& device_from_grip) HAPTIC_RT {
    const Mat3 rotation = glm::mat3_cast(device_from_grip.orientation);
    StringArray lengths{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        lengths[i] = string_state(variant.strings[i], rotation, device_from_grip.position).length;
    }
    return lengths;
}

WireMatrix wire_matrix(const device::Variant& variant, const Pose& device_from_grip) HAPTIC_RT {
    const Mat3 rotation = glm::mat3_cast(device_from_grip.orientation);
    WireMatrix wires{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        const StringState state = string_state(variant.strings[i], rotation, device_from_grip.position);
        const Vec3 moment = glm::cross(state.arm, state.direction);
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

PoseSolver::PoseSolver(const device::Variant& variant) : variant_(variant) {
    double radius = 0.0;
    for (const device::StringFacts& string : variant.strings) {
        radius = std::max(radius, glm::length(string.grip));
        reach_ = std::max(reach_, glm::length(string.motor));
    }
    if (!(radius > 0.0) || !std::isfinite(radius) || !(reach_ > 0.0) || !std::isfinite(reach_)) {
        throw std::invalid_argument("pose solver: variant '" + variant.name + "' has no finite geometry");
    }
    rotation_scale_ = 1.0 / radius;
    for (std::size_t i = 0; i < kStrings; ++i) {
        for (std::size_t k = 0; k < 3; ++k) {
            const auto component = static_cast<Vec3::length_type>(k);
            motor_[k][i] = variant.strings[i].motor[component];
            grip_[k][i] = variant.strings[i].grip[component];
        }
    }
}

void PoseSolver::reset(const Pose& pose) HAPTIC_RT {
    const Quat& q = pose.orientation;
    const double squared = glm::dot(q, q);
    estimate_ = PoseEstimate{};
    if (is_finite(pose.position) && std::isfinite(squared) && squared > 0.0) {
        estimate_.pose = {shortened(pose.position, reach_), q * (1.0 / std::sqrt(squared))};
    }
}

PoseStatus PoseSolver::improve(const StringArray& lengths, std::size_t without, Pose& pose) const HAPTIC_RT {
    const Mat3 r = glm::mat3_cast(pose.orientation);
    const Vec3 p = pose.position;
    // Column-wise, one lane a string, without branches, so that the compiler takes several strings at a time.
    std::array<StringArray, 6> columns{};
    StringArray error{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        const double bx = grip_[0][i];
        const double by = grip_[1][i];
        const double bz = grip_[2][i];
        const double arm_x = r[0][0] * bx + r[1][0] * by + r[2][0] * bz;
        const double arm_y = r[0][1] * bx + r[1][1] * by + r[2][1] * bz;
        const double arm_z = r[0][2] * bx + r[1][2] * by + r[2][2] * bz;
        const double span_x = motor_[0][i] - p.x - arm_x;
        const double span_y = motor_[1][i] - p.y - arm_y;
        const double span_z = motor_[2][i] - p.z - arm_z;
        const double length = std::sqrt(span_x * span_x + span_y * span_y + span_z * span_z);
        const double inverse = 1.0 / std::max(length, kLeastLength);
        const double ux = span_x * inverse;
        const double uy = span_y * inverse;
        const double uz = span_z * inverse;
        columns[0][i] = ux;
        columns[1][i] = uy;
        columns[2][i] = uz;
        columns[3][i] = (arm_y * uz - arm_z * uy) * rotation_scale_;
        columns[4][i] = (arm_z * ux - arm_x * uz) * rotation_scale_;
        columns[5][i] = (arm_x * uy - arm_y * ux) * rotation_scale_;
        error[i] = length - lengths[i];  // dl = -A dx
    }
    if (without < kStrings) {
        for (StringArray& column : columns) {
            column[without] = 0.0;
        }
    }
    Mat6 normal{};
    Vec6 step{};
    for (std::size_t j = 0; j < 6; ++j) {
        step[j] = dot(columns[j], error);
        for (std::size_t k = 0; k <= j; ++k) {
            normal[j][k] = dot(columns[j], columns[k]);
        }
    }
    if (!solve_symmetric(normal, step)) {
        return PoseStatus::RankDeficient;
    }
    const Vec3 translation = shortened({step[0], step[1], step[2]}, kLongestStep);
    const Vec3 turn = shortened(Vec3(step[3], step[4], step[5]) * rotation_scale_, kWidestStep);
    if (!is_finite(translation) || !is_finite(turn)) {
        return PoseStatus::NonFinite;
    }
    pose.position = shortened(pose.position + translation, reach_);
    pose.orientation = turned(pose.orientation, turn);
    return PoseStatus::Ok;
}

PoseEstimate PoseSolver::solve_from(const Pose& start, const StringArray& lengths,
                                    std::size_t without) const HAPTIC_RT {
    PoseEstimate next{start, 0.0, PoseStatus::Ok, {}};
    for (const double length : lengths) {
        if (!std::isfinite(length)) {
            next.status = PoseStatus::NonFinite;
        }
    }
    for (int iteration = 0; iteration < kIterations && next.status == PoseStatus::Ok; ++iteration) {
        next.status = improve(lengths, without, next.pose);
    }
    if (next.status == PoseStatus::Ok) {
        const StringArray explained = string_lengths(variant_, next.pose);
        double sum = 0.0;
        for (std::size_t i = 0; i < kStrings; ++i) {
            next.residuals[i] = lengths[i] - explained[i];
            sum += i == without ? 0.0 : next.residuals[i] * next.residuals[i];
        }
        next.residual = std::sqrt(sum / static_cast<double>(kStrings));
        if (!std::isfinite(next.residual)) {
            next.status = PoseStatus::NonFinite;
        }
    }
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
