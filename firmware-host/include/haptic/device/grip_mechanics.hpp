// Grip mechanics: a rigid body held by a hand and by eight elastic strings, each wound by a motor at its other end.
//
//     M v' = sum T_i u_i - d v + hand            T_i = max(0, k e_i + c e_i') where e_i > 0, else 0
//     L'   = sum r_i x T_i u_i - d_r w + hand    e_i = |a_i - p - R b_i| - (s_i + slack_i)
//     m s_i'' = T_i - pull_i - b s_i' - friction sign(s_i')
//
// s_i is the unloaded length of string between pulley and knot: motor i has paid it out, encoder i counts it. Strings
// only pull. The README derives the equations and the bound of the step.
#pragma once

#include <array>
#include <cstdint>

#include "haptic/device/device_geometry.hpp"
#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic::device {

/// Who holds the grip.
enum class Hand : std::uint8_t {
    Impedance,  // a spring and a damper to the pose of the hand's track
    Free        // nobody; before a waiting hand is released it holds the grip rigidly
};

/// Parameters. Values that no published source gives are marked as guesses.
struct GripMechanics {
    Hand hand = Hand::Impedance;

    double mass = 0.1;                      // kg, grip and the part of the hand that moves with it
    Vec3 inertia{2e-5, 2e-5, 2e-5};         // kg m^2, principal, grip frame; a ball of 0.1 kg and 22.5 mm
    double damping = 0.3;                   // N s/m, of the grip relative to the device
    double rotational_damping = 6e-5;       // N m s/rad; same decay time as the translation
    double string_stiffness = 20'000.0;     // N/m, guess
    double string_damping = 2.0;            // N s/m, guess
    double motor_mass = 0.015;              // kg, rotor inertia / pulley radius^2; guess
    double motor_drag = 0.05;               // N s/m at the string, guess
    double motor_friction = 0.02;           // N at the string, Coulomb; guess
    double hand_stiffness = 400.0;          // N/m, a loose hold; 100 to 1000 are reported
    double hand_damping = 4.0;              // N s/m
    double hand_rotational_stiffness = 1;   // N m/rad
    double hand_rotational_damping = 0.01;  // N m s/rad
};

/// Throws std::invalid_argument that names the parameter: a mass that is not positive, anything negative or not finite.
void validate(const GripMechanics& mechanics);

struct GripState {
    Pose pose;
    Vec3 velocity{0.0, 0.0, 0.0};                // m/s
    Vec3 angular_momentum{0.0, 0.0, 0.0};        // kg m^2/s, device frame; stored instead of the angular velocity so
                                                 // that it is conserved exactly without torque
    std::array<double, kStrings> length{};       // m, s_i, at least 0
    std::array<double, kStrings> length_rate{};  // m/s
};

/// Inputs to grip and motors during a step.
struct GripLoad {
    std::array<double, kStrings> pull{};   // N, of the motors; negative: a motor with the wrong polarity unwinds
    std::array<double, kStrings> slack{};  // m by which a string is longer than its motor has paid out
    Pose hand;
    Twist hand_velocity;
    bool held = false;  // the grip is fixed; only the motors move
};

/// State at rest, with every string just straight.
[[nodiscard]] GripState grip_at_rest(const DeviceGeometry& geometry, const Pose& pose) HAPTIC_RT;

/// Velocity of the grip.
[[nodiscard]] Twist twist_of(const GripMechanics& mechanics, const GripState& state) HAPTIC_RT;

/// Tensions T_i that the strings carry, N; 0 if slack.
[[nodiscard]] std::array<double, kStrings> string_tensions(const DeviceGeometry& geometry,
                                                           const GripMechanics& mechanics, const GripState& state,
                                                           const std::array<double, kStrings>& slack) HAPTIC_RT;

/// Force and torque of the tensions on the grip.
[[nodiscard]] Wrench wrench_of_strings(const DeviceGeometry& geometry, const Pose& grip,
                                       const std::array<double, kStrings>& tensions) HAPTIC_RT;

/// Force and torque of the hand's spring and damper on the grip. With the angle a from grip to hand, the elastic torque
/// is 2 K sin(a / 2) about the axis of rotation. It is the gradient of 4 K (1 - cos(a / 2)), so it is conservative for
/// rotations of any size.
[[nodiscard]] Wrench wrench_of_hand(const GripMechanics& mechanics, const GripState& state, const Pose& hand,
                                    const Twist& hand_velocity) HAPTIC_RT;

/// Rotation vector of the shorter rotation between two orientations, rad, device frame. Its length is 2 sin(angle / 2),
/// which approximates the angle of a small rotation.
[[nodiscard]] Vec3 small_rotation_between(const Quat& from, const Quat& to) HAPTIC_RT;
/// `orientation` rotated further by a small rotation vector, rad, device frame; normalised.
[[nodiscard]] Quat rotated(const Quat& orientation, const Vec3& rotation) HAPTIC_RT;

/// One step of the semi-implicit Euler method: velocities from forces, then positions from the new velocities. Friction
/// stops a motor and never reverses it. Constant work: 8 strings, about 0.3 us.
/// @source Hairer, Lubich, Wanner, Geometric Numerical Integration, I.1.2.
[[nodiscard]] GripState step(const DeviceGeometry& geometry, const GripMechanics& mechanics, const GripState& state,
                             const GripLoad& load, double step_s) HAPTIC_RT;

/// Half of the longest step, s, for which step() is stable at every pose (README).
[[nodiscard]] double longest_step_s(const DeviceGeometry& geometry, const GripMechanics& mechanics);

}  // namespace haptic::device
