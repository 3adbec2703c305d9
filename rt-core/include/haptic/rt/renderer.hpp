// Force and torque of the newest contact frame on the grip.
//
// For each proxy particle i of N: its goal g_i = p + R o_i is where the grip has it, its local proxy x_i the point
// nearest to g_i that the frame's planes allow at this tick's time. A particle whose planes hold it back is in contact:
//     d = x_i - g_i,  n = d / |d|,  f_i = max(0, k |d| + b (v_surface - v_goal) . n) n
//     F = sum f_i / N,  T = sum (R o_i) x f_i / N - b_r omega (particles in contact) / N
// so that damping acts in contact only, never pulls into a surface, and leaves free motion without force: there F and T
// are exactly zero. Where the frame has friction, a particle is held at x_i + t_i (surface_grip.hpp) and k t_i comes to
// f_i, less as damping takes from the normal force. v_surface . n follows from the velocities of the active planes.
// What is felt follows F and T as wrench_follower.hpp says, so that the hand feels no seams between frames.
// @source thesis, section 5.2.2: only collided particles count, the sums are divided by the number of all
// particles; torque is that of the translational springs about the grip's origin. The frame's rotational stiffness is
// carried but not used: the lever of the particles already makes the rotational spring.
#pragma once

#include <array>
#include <cstdint>
#include <limits>

#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"
#include "haptic/rt/local_proxy.hpp"
#include "haptic/rt/surface_grip.hpp"
#include "haptic/rt/wrench_follower.hpp"
#include "haptic/types.hpp"

namespace haptic::rt {

/// The grip at an instant, and how it got there.
struct GripMotion {
    Pose pose;
    Twist velocity;
    Pose before;             // elapsed_s ago
    double elapsed_s = 0.0;  // s; 0: no way is known, and none is told
};

/// What the planes do to the grip at an instant.
struct Contact {
    Wrench wrench;
    Wrench spring;                         // without the damping
    Vec3 proxy{0.0, 0.0, 0.0};             // m, local proxy of the first particle; the grip where there is none
    std::uint32_t in_contact = 0;          // particles
    double stored = 0.0;                   // J, in the springs: sum k |d|^2 / 2 / N
    double surface_power = 0.0;            // W, that moving surfaces put into the springs: sum k |d| v_surface . n / N
    Vec3 surface_velocity{0.0, 0.0, 0.0};  // m/s, of the surfaces in contact, weighted with |d|
    double depth = 0.0;                    // m, sum |d| / N
    double way = 0.0;                      // m, sum |way of the particle relative to its surface| / N: over those in
                                           // contact, or over all, relative to the planes in reach, where none is
    double lever = 0.0;                    // m, longest |o_i|
};

/// Of each particle, from tick to tick.
using SurfaceGrips = std::array<SurfaceGrip, kMaxProxies>;

/// The equations above, with planes moved on to time_ns, but at most 1.5 steps past their own time, and with a
/// stiffness (N/m) in place of the frame's. The frame must have passed find_defect(). A clutched frame makes no force.
/// Bounded by kMaxProxies projections.
[[nodiscard]] Contact render(const ContactFrame& frame, double stiffness, const GripMotion& grip, std::int64_t time_ns,
                             SurfaceGrips& grips) HAPTIC_RT;

/// The same with the frame's stiffness and without memory, so without friction.
[[nodiscard]] Contact render(const ContactFrame& frame, const Pose& grip, const Twist& velocity,
                             std::int64_t time_ns) HAPTIC_RT;

struct FrameSettings {
    std::int64_t stale_after_ns = 100'000'000;  // ns; a frame is fresh for at least this long, and for 3 of its steps
    std::int64_t fade_ns = 100'000'000;         // ns, in which the force of a stale frame goes to zero
    std::int64_t ramp_ns = 50'000'000;  // ns, in which the force of a new source is taken up, or a lost one's ends
    /// N/m; a frame that asks for more gets this much (passive_stiffness).
    double largest_stiffness = std::numeric_limits<double>::infinity();
};

/// Keeps the newest good frame and joins what comes from it without a step: from one frame to the next the force
/// follows (WrenchFollower) and a coupling that changes is taken up over a step; the force fades when frames stop, and
/// blends from what was felt to what the new frame says when they come back, when another session begins, and when the
/// clutch is worked.
class FrameRenderer {
  public:
    explicit FrameRenderer(const FrameSettings& settings)
        : settings_(settings), follower_(1e-9 * static_cast<double>(settings.ramp_ns)) {}

    /// Where the next frame is read to; only what accept() takes is rendered.
    [[nodiscard]] ContactFrame& inbox() HAPTIC_RT { return frames_[1 - current_]; }
    /// Takes the frame in the inbox, received at now_ns, if it has no defect. Nothing changes otherwise.
    FrameDefect accept(std::int64_t now_ns) HAPTIC_RT;

    struct Result {
        Contact contact;                   // wrench faded and blended
        std::uint64_t frame_sequence = 0;  // 0: no frame yet
        std::int64_t frame_age_ns = -1;    // since it was published; -1: no frame yet
        bool stale = false;                // there was a frame, and it is too old
        bool stiffness_limited = false;    // it asked for more than largest_stiffness
        bool finite = true;                // else the wrench is zero: coupling times depth or speed had no measure
    };
    /// elapsed_ns: since the last call.
    Result render(const Pose& grip, const Twist& velocity, std::int64_t now_ns, std::int64_t elapsed_ns) HAPTIC_RT;

  private:
    void begin_blend() HAPTIC_RT;
    void move_stiffness_on(std::int64_t elapsed_ns) HAPTIC_RT;
    void render_frame(const GripMotion& grip, std::int64_t now_ns, std::int64_t elapsed_ns, Contact& contact) HAPTIC_RT;
    [[nodiscard]] const ContactFrame& frame() const HAPTIC_RT { return frames_[current_]; }

    FrameSettings settings_;
    std::array<ContactFrame, 2> frames_{};
    std::size_t current_ = 0;
    bool have_frame_ = false;
    std::array<bool, 2> stiffness_limited_{};  // of the frames
    std::int64_t received_ns_ = 0;
    double fade_ = 0.0;   // 1: fresh, 0: faded out
    double blend_ = 1.0;  // 0: blend_from_, 1: the frame
    Wrench blend_from_;
    Wrench last_;
    WrenchFollower follower_;
    SurfaceGrips grips_{};
    Pose last_grip_;
    bool have_grip_ = false;
    double stiffness_ = 0.0;       // N/m, felt now
    double stiffness_from_ = 0.0;  // N/m, when the frame came
    std::int64_t stiffness_age_ns_ = 0;
};

}  // namespace haptic::rt
