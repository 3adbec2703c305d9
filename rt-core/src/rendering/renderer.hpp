// The wrench of the newest contact frame, without a seam from one frame to the next.
//
// What a frame makes of a pose is tool_contact.hpp's. What is felt follows it as wrench_follower.hpp says.
#pragma once

#include <array>
#include <cstdint>
#include <limits>

#include <haptic/frames.hpp>
#include <haptic/realtime.hpp>
#include "rendering/tool_contact.hpp"
#include "rendering/wrench_follower.hpp"
#include <haptic/types.hpp>

namespace haptic::rt {

struct FrameSettings {
    std::int64_t stale_after_ns = 100'000'000;  // ns; a frame is fresh for at least this long, and for 3 of its steps
    std::int64_t fade_ns = 100'000'000;         // ns, in which the force of a stale frame goes to zero
    std::int64_t ramp_ns = 50'000'000;  // ns, in which the force of a new source is taken up, or a lost one's ends
    /// N/m; a frame that asks for more gets this much (passive_stiffness).
    double largest_stiffness = std::numeric_limits<double>::infinity();
    /// N*m/rad; the torque stiffness of a frame is lowered until its particles can make no more (square_lever).
    double largest_rotational_stiffness = std::numeric_limits<double>::infinity();
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
        std::int64_t state_age_ns = -1;    // since the latch of the device state it answers; -1: it answers none
        bool stale = false;                // there was a frame, and it is too old
        bool stiffness_limited = false;    // it asked for more than the largest stiffness
        bool finite = true;                // else the wrench is zero: coupling times depth or speed had no measure
    };
    /// elapsed_ns: since the last call.
    Result render(const Pose& grip, const Twist& velocity, std::int64_t now_ns, std::int64_t elapsed_ns) HAPTIC_RT;

  private:
    void begin_blend() HAPTIC_RT;
    void limit_stiffness() HAPTIC_RT;
    void move_stiffness_on(std::int64_t elapsed_ns) HAPTIC_RT;
    void render_frame(const GripMotion& grip, std::int64_t now_ns, std::int64_t elapsed_ns, Contact& contact) HAPTIC_RT;
    [[nodiscard]] const ContactFrame& frame() const HAPTIC_RT { return frames_[current_]; }

    FrameSettings settings_;
    std::array<ContactFrame, 2> frames_{};
    std::size_t current_ = 0;
    bool have_frame_ = false;
    std::array<Stiffness, 2> coupling_{};      // of the frames, as far as it is allowed
    std::array<bool, 2> stiffness_limited_{};  // likewise
    std::int64_t received_ns_ = 0;
    double fade_ = 0.0;   // 1: fresh, 0: faded out
    double blend_ = 1.0;  // 0: blend_from_, 1: the frame
    Wrench blend_from_;
    Wrench last_;
    WrenchFollower follower_;
    ToolMemory memory_;
    Pose last_grip_;
    bool have_grip_ = false;
    Stiffness stiffness_;       // felt now
    Stiffness stiffness_from_;  // when the frame came
    std::int64_t stiffness_age_ns_ = 0;
};

}  // namespace haptic::rt
