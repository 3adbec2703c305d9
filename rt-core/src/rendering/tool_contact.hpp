// Force and torque of a contact frame on the grip, at an instant.
//
// For each proxy particle i of N: its goal g_i = p + R o_i is where the grip has it, its local proxy x_i the point
// nearest to g_i that the frame's planes allow at this tick's time. A particle whose planes hold it back is in contact:
//     d = x_i - g_i,  n = d / |d|,  f_i = max(0, k |d| + b (v_surface - v_goal) . n) n
//     F = sum f_i / N,  T = sum (R o_i) x f_i / N - b_r omega (particles in contact) / N
// so that damping acts in contact only, never pulls into a surface, and leaves free motion without force: there F and T
// are exactly zero. T is made with the frame's torque stiffness in place of k. Where the frame has friction, a particle
// is held at x_i + t_i (surface_grip.hpp) and k t_i comes to f_i, less as damping takes from the normal force. While
// the frame too says that it sticks, where it sticks goes to where the frame has it, in 0.1 s. v_surface . n follows
// from the velocities of the active planes.
//
// With HAPTIC_FRAME_SERIES_SPRINGS the springs are those of series_springs.hpp, over all planes of all particles, and
// the pushes are not divided: f_i is the sum of the particle's pushes, b is divided as they are, and friction is as
// much of k t_i as f_i is of k |d|. With HAPTIC_FRAME_HOLD_POSITIONS x_i is where the frame has the particle if it
// touches, else g_i: planes are not looked at.
// @source thesis, section 5.2.2: only collided particles count, the sums are divided by the number of all particles;
// 5.4.1: positions and flags for the haptic thread
#pragma once

#include <array>
#include <cstdint>

#include <haptic/frames.hpp>
#include <haptic/realtime.hpp>
#include <haptic/rt/surface_grip.hpp>
#include <haptic/series_springs.hpp>
#include <haptic/types.hpp>

namespace haptic::rt {

/// The grip at an instant, and how it got there.
struct GripMotion {
    Pose pose;
    Twist velocity;
    Pose before;             // elapsed_s ago
    double elapsed_s = 0.0;  // s; 0: no way is known, and none is told
};

/// Of the particles' springs where they make the force and where they make the torque.
struct Stiffness {
    double force = 0.0;   // N/m
    double torque = 0.0;  // N/m
};
/// That of a frame: without a torque stiffness of its own the torque is that of the force's springs.
[[nodiscard]] inline Stiffness stiffness_of(const ContactFrame& frame) HAPTIC_RT {
    return {frame.stiffness, frame.torque_stiffness > 0.0 ? frame.torque_stiffness : frame.stiffness};
}
/// m^2, what a torque stiffness (N/m) is multiplied with for the most stiffness (N*m/rad) that it can make about an
/// axis: the mean of |o_i|^2, and with springs in series two thirds of it, exactly.
[[nodiscard]] double square_lever(const ContactFrame& frame) HAPTIC_RT;

/// What the planes do to the grip at an instant. With springs in series sums are not divided by N.
struct Contact {
    Wrench wrench;
    Wrench spring;                         // without the damping
    Vec3 proxy{0.0, 0.0, 0.0};             // m, local proxy of the first particle; the grip where there is none
    std::uint32_t in_contact = 0;          // particles
    double stored = 0.0;                   // J, in the springs: sum k |d|^2 / 2 / N, with the larger of k and k_t
    double surface_power = 0.0;            // W, that moving surfaces put into the springs: sum k |d| v_surface . n / N
    Vec3 surface_velocity{0.0, 0.0, 0.0};  // m/s, of the surfaces in contact, weighted with |d|
    double depth = 0.0;                    // m, sum |f_i| / k / N of the springs
    double way = 0.0;                      // m, sum |way of the particle relative to its surface| / N: over those in
                                           // contact, or over all, relative to the planes in reach, where none is.
                                           // With springs in series half the root of the sum of the squares: what
                                           // bounds the way of the offset
    double lever = 0.0;                    // m, longest |o_i|
};

/// What is kept from tick to tick.
struct ToolMemory {
    std::array<SurfaceGrip, kMaxProxies> grips{};
    SeriesSprings springs;
    std::array<SpringRow, kMaxSpringRows> rows{};  // scratch, which need not be cleared in each tick
};

/// The equations above, with planes moved on to time_ns, but at most 1.5 steps past their own time, and with a
/// stiffness in place of the frame's. The frame must have passed find_defect(). A clutched frame makes no force.
/// Bounded by kMaxProxies projections and one SeriesSprings::solve().
[[nodiscard]] Contact render(const ContactFrame& frame, const Stiffness& stiffness, const GripMotion& grip,
                             std::int64_t time_ns, ToolMemory& memory) HAPTIC_RT;

/// The same with the frame's stiffness and without memory, so without friction.
[[nodiscard]] Contact render(const ContactFrame& frame, const Pose& grip, const Twist& velocity,
                             std::int64_t time_ns) HAPTIC_RT;

}  // namespace haptic::rt
