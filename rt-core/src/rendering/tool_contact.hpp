// Tool contact: force and torque of a contact frame on the grip, at an instant.
//
// For each proxy particle i of N: its goal g_i = p + R o_i is where the grip puts it (thesis, eq. 5.1), its local proxy
// x_i the point nearest to g_i that the frame's planes allow at this tick's time. A particle held back by its planes is
// in contact:
//     d = x_i - g_i,  n = d / |d|,  f_i = max(0, k |d| + b (v_surface - v_goal) . n) n
//     F = sum f_i / N,  T = sum (R o_i) x f_i / N - b_r omega (particles in contact) / N
// Damping therefore acts in contact only and never pulls into a surface. In free motion F and T are exactly zero. T
// uses the frame's torque stiffness in place of k. If the frame has friction, a particle is held at x_i + t_i
// (friction.hpp) and k t_i is added to f_i, less in proportion as damping reduces the normal force. While the frame
// reports the particle as sticking too, its sticking position moves to the frame's with a time constant of 0.1 s.
// v_surface . n follows from the velocities of the active planes.
//
// With HAPTIC_FRAME_SERIES_SPRINGS the springs are those of series_springs.hpp, over all planes of all particles, and
// the pushes are not divided by N: f_i is the sum of the particle's pushes, b is divided among the particles in
// proportion to their pushes, and friction is k t_i times f_i / (k |d|). With HAPTIC_FRAME_HOLD_POSITIONS x_i is the
// frame's position of the particle if it touches, else g_i; planes are ignored.
// @source thesis, section 5.2.2: only collided particles count, the sums are divided by the number of all particles;
// 5.4.1: positions and flags for the haptic thread
#pragma once

#include <array>
#include <cstdint>

#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"
#include "haptic/series_springs.hpp"
#include "haptic/types.hpp"
#include "rendering/friction.hpp"

namespace haptic::rt {

/// Pose and velocity of the grip at an instant, and its pose at the tick before.
struct GripMotion {
    Pose pose;
    Twist velocity;
    Pose previous;           // elapsed_s ago
    double elapsed_s = 0.0;  // s; 0: the previous pose is unknown, and displacements are zero
};

/// Stiffness of a particle's spring, for the force and for the torque.
struct Stiffness {
    double force = 0.0;   // N/m
    double torque = 0.0;  // N/m
};
/// Stiffness of a frame. Without a torque stiffness of its own the torque uses that of the force.
[[nodiscard]] inline Stiffness stiffness_of(const ContactFrame& frame) HAPTIC_RT {
    return {frame.stiffness, frame.torque_stiffness > 0.0 ? frame.torque_stiffness : frame.stiffness};
}
/// m^2, factor from a torque stiffness (N/m) to the largest rotational stiffness (N*m/rad) that it can make about an
/// axis: the mean of |o_i|^2; with springs in series two thirds of it, exactly.
[[nodiscard]] double squared_moment_arm(const ContactFrame& frame) HAPTIC_RT;

/// Effect of the contact frame on the grip at an instant. With springs in series the sums are not divided by N.
struct Contact {
    Wrench wrench;
    Wrench spring;                         // the wrench without damping
    Vec3 proxy{0.0, 0.0, 0.0};             // m, local proxy of the first particle; the grip if there is no particle
    std::uint32_t in_contact = 0;          // particles
    double stored = 0.0;                   // J, in the springs: sum k |d|^2 / 2 / N, with the larger of k and k_t
    double surface_power = 0.0;            // W, that moving surfaces put into the springs: sum k |d| v_surface . n / N
    Vec3 surface_velocity{0.0, 0.0, 0.0};  // m/s, mean over the surfaces in contact, weighted with |d|
    double depth = 0.0;                    // m, sum |f_i| / k / N of the springs
    // m, sum |u_i| / N, with u_i the displacement of particle i relative to its surface since the last tick: over the
    // particles in contact, or over all, relative to their planes, if none is. With springs in series half the root of
    // the sum of squares, which bounds the displacement of the springs' offset.
    double displacement = 0.0;
    double max_moment_arm = 0.0;  // m, largest |o_i|
};

/// State kept from tick to tick.
struct ToolMemory {
    std::array<FrictionState, kMaxProxies> friction{};
    SeriesSprings springs;
    std::array<SpringRow, kMaxSpringRows> rows{};  // scratch; needs no clearing
};

/// Evaluates the equations above, with planes extrapolated to time_ns, but at most 1.5 steps beyond their own time, and
/// with the given stiffness in place of the frame's. The frame must have passed find_defect(). A clutched frame makes
/// no force. Bounded by kMaxProxies projections and one SeriesSprings::solve().
[[nodiscard]] Contact render(const ContactFrame& frame, const Stiffness& stiffness, const GripMotion& grip,
                             std::int64_t time_ns, ToolMemory& memory) HAPTIC_RT;

/// The same with the frame's stiffness, and without memory: no friction.
[[nodiscard]] Contact render(const ContactFrame& frame, const Pose& grip, const Twist& velocity,
                             std::int64_t time_ns) HAPTIC_RT;

}  // namespace haptic::rt
