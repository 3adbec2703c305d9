// Pose of the grip from the lengths of its eight strings, and back.
//
// String i runs from motor a_i (device frame) to grip point b_i (grip frame). With the pose (p, R), r_i = R b_i,
// w_i = a_i - (p + r_i), l_i = |w_i| is its length, u_i = w_i / l_i its direction from grip to motor, m_i = r_i x u_i.
// Row i of the wire matrix A (8 x 6) is [u_i, m_i]: the wrench of tensions t is A^T t, and dl = -A dx.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include <haptic/device/variant.hpp>
#include <haptic/frames.hpp>
#include <haptic/realtime.hpp>
#include <haptic/types.hpp>

namespace haptic::rt {

using StringArray = std::array<double, kStrings>;
using Vec6 = std::array<double, 6>;             // [translation or force, rotation or torque]
using WireMatrix = std::array<Vec6, kStrings>;  // row per string

/// Lengths of all strings at a pose, m.
[[nodiscard]] StringArray string_lengths(const device::Variant& variant, const Pose& device_from_grip) HAPTIC_RT;

/// Wire matrix at a pose. A string of no length gets a zero row.
[[nodiscard]] WireMatrix wire_matrix(const device::Variant& variant, const Pose& device_from_grip) HAPTIC_RT;

/// A^T t: what the strings do to the grip, torque about the grip's origin, device frame.
[[nodiscard]] Wrench wrench_of_tensions(const WireMatrix& wires, const StringArray& tensions) HAPTIC_RT;

enum class PoseStatus : std::uint8_t {
    Ok,
    RankDeficient,  // the strings do not determine the pose here; the last good one is kept
    NonFinite       // a length was not finite; likewise
};

struct PoseEstimate {
    Pose pose;              // device_from_grip
    double residual = 0.0;  // m, root mean square of measured minus explained lengths (8 - 6 = 2 are redundant)
    PoseStatus status = PoseStatus::Ok;
    StringArray residuals{};  // m, measured minus explained, of each string
};

/// Least squares of 6 unknowns on 8 lengths: Gauss-Newton, warm-started at the last pose, with a fixed number of
/// iterations and rotation columns scaled by the grip's radius, so that metres and radians weigh alike. (An unscaled
/// damping of 1e-3, as published drivers use, makes the attitude lag for ten updates.)
class PoseSolver {
  public:
    static constexpr int kIterations = 2;

    explicit PoseSolver(const device::Variant& variant);

    /// Sets the pose that the next solve starts from. One that is not finite counts as the centre.
    void reset(const Pose& pose) HAPTIC_RT;
    /// Fixed work. The estimate is always finite and its orientation of unit length.
    const PoseEstimate& solve(const StringArray& lengths) HAPTIC_RT;
    /// The same from any start, without remembering it, and as if there were no string `without`: the residual is that
    /// of the other seven. On a status other than Ok the pose is `start` and there are no residuals.
    [[nodiscard]] PoseEstimate solve_without(std::size_t without, const StringArray& lengths,
                                             const Pose& start) const HAPTIC_RT;

  private:
    static constexpr std::size_t kNone = kStrings;  // no string is left out

    PoseStatus improve(const StringArray& lengths, std::size_t without, Pose& pose) const HAPTIC_RT;
    [[nodiscard]] PoseEstimate solve_from(const Pose& start, const StringArray& lengths,
                                          std::size_t without) const HAPTIC_RT;

    device::Variant variant_;
    std::array<StringArray, 3> motor_{};  // m, x, y and z of all motors: variant_'s, one lane a string
    std::array<StringArray, 3> grip_{};   // m, likewise of the knots
    double rotation_scale_ = 1.0;         // 1/m
    double reach_ = 0.0;                  // m, no grip is further from the centre than the motors are
    PoseEstimate estimate_;
};

}  // namespace haptic::rt
