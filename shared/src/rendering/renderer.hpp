// Frame renderer: the wrench of the newest contact frame, continuous from one frame to the next.
//
// tool_contact.hpp evaluates a frame at a pose; wrench_follower.hpp bounds how fast the rendered wrench follows. What a
// new frame, or another stiffness, changes at an unchanged pose is told apart from what the motion of hand and surfaces
// changes: the follower renders the second at once and the first gradually, and the passivity observer is charged with
// the energy of the first.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>

#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"
#include "haptic/types.hpp"
#include "rendering/prepared_frame.hpp"
#include "rendering/tool_contact.hpp"
#include "rendering/wrench_follower.hpp"

namespace haptic {

struct FrameSettings {
    std::int64_t stale_after_ns = 100'000'000;  // ns; a frame is fresh for the longer of this and 3 of its steps
    std::int64_t fade_ns = 100'000'000;         // ns, in which the wrench of a stale frame fades to zero
    std::int64_t ramp_ns = 50'000'000;          // ns, in which the wrench blends to a new source, or ends after contact
    /// N/m; a larger stiffness of a frame is reduced to this (passive_stiffness).
    double max_stiffness = std::numeric_limits<double>::infinity();
    /// N*m/rad; the stiffness of a frame is reduced until its tool can make at most this.
    double max_rotational_stiffness = std::numeric_limits<double>::infinity();
};

/// Keeps the newest valid frame and renders it without steps in the wrench:
/// - from one frame to the next the wrench follows (WrenchFollower), and a changed stiffness is interpolated over a
///   simulation step;
/// - when frames stop, the wrench fades to zero;
/// - when they resume, when another session begins, and when the clutch changes, the wrench blends from the last
///   rendered one to that of the frame.
class FrameRenderer {
  public:
    explicit FrameRenderer(const FrameSettings& settings)
        : settings_(settings), follower_(1e-9 * static_cast<double>(settings.ramp_ns)) {}

    /// The next frame: to be filled in and prepared, or exchanged for one that is. It is rendered only after accept().
    /// The renderer owns its first two frames; one that comes in exchange must outlive it.
    [[nodiscard]] PreparedFrame*& inbox() HAPTIC_RT { return inbox_; }
    /// Takes the frame in the inbox, received at now_ns, if it has no defect; otherwise nothing changes.
    FrameDefect accept(std::int64_t now_ns) HAPTIC_RT;
    /// The same for a copy of this frame, which it prepares.
    FrameDefect accept(const ContactFrame& frame, std::int64_t now_ns) HAPTIC_RT;

    /// For ToolContact::preview_ahead() of the next frame, after render().
    [[nodiscard]] FrameStart next_start() const HAPTIC_RT { return tool_.next_start(last_grip_, last_ns_); }

    struct Result {
        Contact contact;                   // with the wrench faded, blended and followed
        std::uint64_t frame_sequence = 0;  // 0: no frame yet
        std::int64_t frame_age_ns = -1;    // since it was published; -1: no frame yet
        std::int64_t state_age_ns = -1;    // since the latch of the device state it was computed from; -1: none
        bool stale = false;                // there is a frame, and it is too old
        double stiffness = 0.0;            // N/m, of the coupling as rendered now, after limits and interpolation
        bool reported = false;             // a new frame reports the bodies' work
        double body_work = 0.0;            // J, by which that is more than the last frame's
        double scale = 0.0;                // 0..1, part of the frame's wrench in the rendered one: fade and blend
        bool stiffness_limited = false;    // the frame's stiffness was reduced
        bool finite = true;                // false: the wrench overflowed and is zero
    };
    /// Wrench at a pose of the grip. elapsed_ns: since the last call.
    Result render(const Pose& grip, std::int64_t now_ns, std::int64_t elapsed_ns) HAPTIC_RT;

  private:
    void begin_blend() HAPTIC_RT;
    void note_work(const ContactFrame& next) HAPTIC_RT;
    void limit_stiffness() HAPTIC_RT;
    void interpolate_stiffness(std::int64_t elapsed_ns) HAPTIC_RT;
    void render_frame(const GripMotion& grip, std::int64_t now_ns, std::int64_t elapsed_ns, Contact& contact) HAPTIC_RT;
    [[nodiscard]] Wrench springs_at_last_pose(double stiffness_before) HAPTIC_RT;
    [[nodiscard]] const ContactFrame& frame() const HAPTIC_RT { return current_->frame; }

    FrameSettings settings_;
    std::array<std::unique_ptr<PreparedFrame>, 2> owned_{std::make_unique<PreparedFrame>(),
                                                         std::make_unique<PreparedFrame>()};
    PreparedFrame* current_ = owned_[0].get();
    PreparedFrame* inbox_ = owned_[1].get();
    bool have_frame_ = false;
    double coupling_ = 0.0;           // N/m, of the frame, after the limits
    bool stiffness_limited_ = false;  // of the frame
    std::int64_t received_ns_ = 0;
    double fade_ = 0.0;   // 1: fresh, 0: faded out
    double blend_ = 1.0;  // 0: blend_from_, 1: the frame
    Wrench blend_from_;
    Wrench last_;
    WrenchFollower follower_;
    ToolContact tool_;
    Pose last_grip_;
    std::int64_t last_ns_ = 0;
    bool have_grip_ = false;
    Wrench springs_;               // of the last render, before the follower, at its stiffness
    bool have_springs_ = false;    // a frame was rendered then
    bool frame_is_new_ = false;    // it has not been rendered yet
    bool reported_ = false;        // the bodies' work, since the last render
    double stiffness_ = 0.0;       // N/m, in use now
    double stiffness_from_ = 0.0;  // N/m, when the frame arrived
    std::int64_t stiffness_age_ns_ = 0;
    double body_work_ = 0.0;  // J, since the last render
};

}  // namespace haptic
