// Kinematics of the string-driven grip: lengths and wire matrix of a pose, and the pose of measured lengths.
//
// String i runs from motor a_i (device frame) to its knot b_i on the grip (grip frame). At the pose (p, R):
//     r_i = R b_i               moment arm of the knot
//     w_i = a_i - (p + r_i)     from knot to motor
//     l_i = |w_i|               length
//     u_i = w_i / l_i           direction of the pull
//     m_i = r_i x u_i           moment of a unit tension
// Row i of the wire matrix A (8 x 6) is [u_i, m_i]. Tensions t make the wrench A^T t, and dl = -A dx.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "haptic/device/device_geometry.hpp"
#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic::rt {

using StringArray = std::array<double, kStrings>;
using Vec6 = std::array<double, 6>;             // [translation or force, rotation or torque]
using WireMatrix = std::array<Vec6, kStrings>;  // row per string

/// Lengths of all strings at a pose, m.
[[nodiscard]] StringArray string_lengths(const device::DeviceGeometry& geometry,
                                         const Pose& device_from_grip) HAPTIC_RT;

/// Wire matrix A at a pose. A string of zero length gets a zero row.
[[nodiscard]] WireMatrix wire_matrix(const device::DeviceGeometry& geometry, const Pose& device_from_grip) HAPTIC_RT;

/// A^T t: wrench of the strings on the grip, torque about the grip's origin, device frame.
[[nodiscard]] Wrench wrench_of_tensions(const WireMatrix& wires, const StringArray& tensions) HAPTIC_RT;

enum class PoseStatus : std::uint8_t {
    Ok,
    RankDeficient,  // the strings do not determine the pose here; the last good pose is kept
    NonFinite       // a length was not finite; the last good pose is kept
};

struct PoseEstimate {
    Pose pose;              // device_from_grip
    double residual = 0.0;  // m, rms of the residuals; 8 - 6 = 2 of the lengths are redundant
    PoseStatus status = PoseStatus::Ok;
    StringArray residuals{};  // m, measured length minus length at the pose, of each string
};

/// Forward kinematics: least squares of 6 unknowns on 8 lengths by Gauss-Newton, started at the last pose.
///
/// The number of iterations is fixed. Rotation columns are scaled by the grip's radius, so that metres and radians have
/// equal weight. (An unscaled damping of 1e-3, as in published drivers, makes the orientation lag for ten updates.)
class PoseSolver {
  public:
    static constexpr int kIterations = 2;

    explicit PoseSolver(const device::DeviceGeometry& geometry);

    /// Sets the pose that the next solve starts from. A pose that is not finite counts as the centre.
    void reset(const Pose& pose) HAPTIC_RT;
    /// Pose of the measured lengths (m). Constant time. The estimate is always finite and its orientation normalised.
    const PoseEstimate& solve(const StringArray& lengths) HAPTIC_RT;
    /// Pose of the other seven lengths, leaving out string `without`, started at `start`; does not change the solver's
    /// state. The residual sums seven squares but divides by eight, to compare with solve(). On a status other than Ok
    /// the pose is `start` and residuals are 0.
    [[nodiscard]] PoseEstimate solve_without(std::size_t without, const StringArray& lengths,
                                             const Pose& start) const HAPTIC_RT;

  private:
    static constexpr std::size_t kNone = kStrings;  // no string is left out

    PoseStatus gauss_newton_step(const StringArray& lengths, std::size_t without, Pose& pose) const HAPTIC_RT;
    [[nodiscard]] PoseEstimate solve_from(const Pose& start, const StringArray& lengths,
                                          std::size_t without) const HAPTIC_RT;

    device::DeviceGeometry geometry_;
    std::array<StringArray, 3> motor_{};  // m, x, y and z of all motors, as structure of arrays: one SIMD lane a string
    std::array<StringArray, 3> grip_{};   // m, the same of the knots
    double rotation_scale_ = 1.0;         // 1/m
    double reach_ = 0.0;                  // m, distance of the farthest motor: bound of the grip's position
    PoseEstimate estimate_;
};

}  // namespace haptic::rt
