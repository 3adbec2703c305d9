// How the grip moves: a rigid body in eight elastic strings, each with a motor at its other end, held by a hand.
//
//     M v' = sum T_i u_i - d v + hand            T_i = max(0, k e_i + c e_i') where e_i > 0, else 0
//     L'   = sum r_i x T_i u_i - d_r w + hand    e_i = |a_i - p - R b_i| - (s_i + slack_i)
//     m s_i'' = T_i - pull_i - b s_i' - friction sign(s_i')
//
// s_i is the unloaded length of string between pulley and knot: what motor i has paid out, and what its encoder counts.
// Strings only pull. The README derives the equations and the bound of the step.
#pragma once

#include <array>
#include <cstdint>

#include "haptic/device/variant.hpp"
#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic::device {

/// Who holds the grip.
enum class Hand : std::uint8_t {
    Impedance,  // a spring and a damper to the pose of the hand's track
    Free        // nobody; while a waiting hand has not been released it holds the grip rigidly
};

/// What the published sources do not know is a guess of ours and says so.
struct GripMechanics {
    Hand hand = Hand::Impedance;

    double mass = 0.1;                      // kg, grip and what of the hand moves with it
    Vec3 inertia{2e-5, 2e-5, 2e-5};         // kg m^2, principal, grip frame; a ball of 0.1 kg and 22.5 mm
    double damping = 0.3;                   // N s/m, of the grip against the frame
    double rotational_damping = 6e-5;       // N m s/rad; decays as fast as the translation does
    double string_stiffness = 20'000.0;     // N/m, guess
    double string_damping = 2.0;            // N s/m, guess
    double motor_mass = 0.015;              // kg, rotor's inertia by the square of the pulley's radius; guess
    double motor_drag = 0.05;               // N s/m at the string, guess
    double motor_friction = 0.02;           // N at the string, Coulomb; guess
    double hand_stiffness = 400.0;          // N/m, a hand that holds loosely; 100 to 1000 are reported
    double hand_damping = 4.0;              // N s/m
    double hand_rotational_stiffness = 1;   // N m/rad
    double hand_rotational_damping = 0.01;  // N m s/rad
};

/// Throws std::invalid_argument that names what cannot be: a mass that is not positive, anything negative or not
/// finite.
void validate(const GripMechanics& mechanics);

struct GripState {
    Pose pose;
    Vec3 velocity{0.0, 0.0, 0.0};                // m/s
    Vec3 angular_momentum{0.0, 0.0, 0.0};        // kg m^2/s, device frame; kept rather than a rate, so that without
                                                 // torque it stays exactly what it is
    std::array<double, kStrings> length{};       // m, s_i, at least 0
    std::array<double, kStrings> length_rate{};  // m/s
};

/// What acts on the grip and its motors during a step.
struct GripLoad {
    std::array<double, kStrings> pull{};   // N, of the motors, 0 or more
    std::array<double, kStrings> slack{};  // m, by which a string is longer than its motor has paid out
    Pose hand;
    Twist hand_velocity;
    bool held = false;  // rigidly where it is: only the motors move
};

/// At rest, with every string just straight.
[[nodiscard]] GripState grip_at_rest(const Variant& variant, const Pose& pose) HAPTIC_RT;

/// Velocity of the grip.
[[nodiscard]] Twist twist_of(const GripMechanics& mechanics, const GripState& state) HAPTIC_RT;

/// N, what the strings carry; 0 where slack.
[[nodiscard]] std::array<double, kStrings> string_tensions(const Variant& variant, const GripMechanics& mechanics,
                                                           const GripState& state,
                                                           const std::array<double, kStrings>& slack) HAPTIC_RT;

/// Force and torque of tensions on a grip.
[[nodiscard]] Wrench wrench_of_strings(const Variant& variant, const Pose& grip,
                                       const std::array<double, kStrings>& tensions) HAPTIC_RT;

/// Force and torque of the hand's spring and damper on the grip. The torque is 2 K sin(half the angle) about the axis
/// from grip to hand, the gradient of 4 K (1 - cos(half the angle)), so that a turn of any size stores energy.
[[nodiscard]] Wrench wrench_of_hand(const GripMechanics& mechanics, const GripState& state, const Pose& hand,
                                    const Twist& hand_velocity) HAPTIC_RT;

/// Rotation vector from one orientation to another by the shorter way, rad, device frame: 2 sin(half the angle) long,
/// which for small turns is the angle.
[[nodiscard]] Vec3 small_turn_between(const Quat& from, const Quat& to) HAPTIC_RT;
/// `orientation` turned on by a small rotation vector, rad, device frame; of unit length again.
[[nodiscard]] Quat turned(const Quat& orientation, const Vec3& by) HAPTIC_RT;

/// One step of semi-implicit Euler (velocities from forces, then positions from the new velocities); friction stops a
/// motor and never reverses it. The same work whatever the state: 8 strings, about 0.3 us.
/// @source Hairer, Lubich, Wanner, Geometric Numerical Integration, I.1.2.
[[nodiscard]] GripState step(const Variant& variant, const GripMechanics& mechanics, const GripState& state,
                             const GripLoad& load, double step_s) HAPTIC_RT;

/// s, half of the longest step for which step() is stable whatever the pose (README).
[[nodiscard]] double longest_step_s(const Variant& variant, const GripMechanics& mechanics);

}  // namespace haptic::device
