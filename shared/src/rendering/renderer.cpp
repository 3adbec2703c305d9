#include "rendering/renderer.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "haptic/numeric.hpp"

namespace haptic {
namespace {

// Minimum number of simulation steps for which a frame is fresh; decisive for slow simulations.
constexpr std::int64_t kFreshSteps = 3;
// As a starting stiffness: no interpolation, the frame's stiffness applies at once.
constexpr double kImmediately = -1.0;

}  // namespace

FrameDefect FrameRenderer::accept(std::int64_t now_ns) HAPTIC_RT {
    // A defective frame is rejected and changes nothing.
    if (inbox_->defect() != FrameDefect::None) {
        return inbox_->defect();
    }
    const ContactFrame& candidate = inbox_->frame;
    // Interpolate the stiffness from the present one; blend where continuity cannot be expected.
    stiffness_from_ = stiffness_;
    stiffness_age_ns_ = 0;
    const bool clutch_changed = ((candidate.flags ^ frame().flags) & HAPTIC_FRAME_CLUTCHED) != 0;
    if (have_frame_ && (candidate.session != frame().session || clutch_changed)) {
        begin_blend();
    }
    // Another tool: its particles have no friction state yet.
    if (candidate.session != frame().session || candidate.proxy_count != frame().proxy_count) {
        tool_.forget_friction();
    }
    note_work(candidate);
    // Swap inbox and current frame.
    std::swap(current_, inbox_);
    tool_.load(*current_);
    frame_is_new_ = true;
    limit_stiffness();
    have_frame_ = true;
    received_ns_ = now_ns;
    return FrameDefect::None;
}

FrameDefect FrameRenderer::accept(const ContactFrame& frame, std::int64_t now_ns) HAPTIC_RT {
    inbox_->frame = frame;
    inbox_->prepare();
    return accept(now_ns);
}

/// Adds the work of the bodies in the step of the next frame, and in those of frames that were lost.
void FrameRenderer::note_work(const ContactFrame& next) HAPTIC_RT {
    if (!reports_work(next)) {
        return;
    }
    const double work = next.body_work - frame().body_work;
    if (have_frame_ && next.session == frame().session && std::isfinite(work)) {
        body_work_ += work;
    }
    reported_ = true;
}

void FrameRenderer::limit_stiffness() HAPTIC_RT {
    // One factor for the whole coupling: translational limit, and rotational limit, k_t <o^2> <= limit.
    const double requested = frame().stiffness;
    const double rotational = torque_stiffness_of(frame()) * current_->squared_moment_arm();
    double factor = requested > settings_.max_stiffness ? settings_.max_stiffness / requested : 1.0;
    if (rotational * factor > settings_.max_rotational_stiffness) {
        factor = settings_.max_rotational_stiffness / rotational;
    }
    coupling_ = factor * requested;
    stiffness_limited_ = factor < 1.0;
}

void FrameRenderer::begin_blend() HAPTIC_RT {
    blend_from_ = last_;
    blend_ = 0.0;
    follower_.restart();
    stiffness_from_ = kImmediately;
}

void FrameRenderer::interpolate_stiffness(std::int64_t elapsed_ns) HAPTIC_RT {
    const double to = coupling_;
    stiffness_age_ns_ = std::min(stiffness_age_ns_ + elapsed_ns, frame().step_ns);
    if (stiffness_from_ < 0.0 || stiffness_age_ns_ >= frame().step_ns) {
        stiffness_ = to;
        return;
    }
    // Linear over one step of the simulation.
    const double part = static_cast<double>(stiffness_age_ns_) / static_cast<double>(frame().step_ns);
    stiffness_ = stiffness_from_ + part * (to - stiffness_from_);
}

/// The springs of the frame at the pose and time of the last render, at the present stiffness.
Wrench FrameRenderer::springs_at_last_pose(double stiffness_before) HAPTIC_RT {
    if (frame_is_new_ || !(stiffness_before > 0.0)) {
        const Wrench springs = tool_.springs_at(last_grip_, last_ns_);
        return {stiffness_ * springs.force, stiffness_ * springs.torque};
    }
    // The same frame: its problem is linear in the stiffness.
    const double factor = stiffness_ / stiffness_before;
    return {factor * springs_.force, factor * springs_.torque};
}

void FrameRenderer::render_frame(const GripMotion& grip, std::int64_t now_ns, std::int64_t elapsed_ns,
                                 Contact& contact) HAPTIC_RT {
    // What the frame asks for at the last pose and at the present one, with this tick's stiffness.
    const double stiffness_before = stiffness_;
    interpolate_stiffness(elapsed_ns);
    const bool rendered = have_springs_ && grip.elapsed_s > 0.0;
    const Wrench before = rendered ? springs_at_last_pose(stiffness_before) : Wrench{};
    const bool known = rendered && is_finite(before);
    contact = tool_.render(stiffness_, grip, now_ns);
    if ((frame().flags & HAPTIC_FRAME_HOLD_POSITIONS) != 0) {
        follower_.restart();  // the thesis' scheme is rendered unchanged, including its discontinuities
    }
    // Follow the frame's wrench within the bound of wrench_follower.hpp.
    const double torque_ratio =
        frame().stiffness > 0.0 ? std::sqrt(std::max(1.0, frame().torque_stiffness / frame().stiffness)) : 1.0;
    WantedWrench wanted{.wrench = contact.wrench,
                        .force_of_motion = stiffness_ * contact.share * contact.displacement,
                        .max_force_of_motion = stiffness_ * contact.tool_displacement,
                        .max_moment_arm = torque_ratio * contact.max_moment_arm,
                        .in_contact = contact.in_contact > 0};
    if (known) {
        wanted.announced = {contact.wrench.force - before.force, contact.wrench.torque - before.torque};
        const double change = stiffness_ > 0.0 ? std::fabs(1.0 - stiffness_before / stiffness_) : 0.0;
        wanted.force_of_stiffness = change * glm::length(before.force);
        wanted.torque_of_stiffness = change * glm::length(before.torque);
    }
    springs_ = contact.wrench;
    have_springs_ = true;
    frame_is_new_ = false;
    contact.wrench = follower_.follow(wanted, 1e-9 * static_cast<double>(elapsed_ns));
    // Power of the announced surfaces, for the passivity observer: power at the springs, plus power of the difference
    // between rendered and spring force, which is due to the follower. An approaching surface works against the
    // rendered force. A receding one takes at most the power of the springs: with the hand at rest nothing else leaves
    // them.
    const double spring_power = contact.surface_power;
    const double power = spring_power + glm::dot(contact.wrench.force - springs_.force, contact.surface_velocity);
    contact.surface_power = power >= 0.0 ? power : std::min(0.0, std::max(power, spring_power));
}

FrameRenderer::Result FrameRenderer::render(const Pose& grip, std::int64_t now_ns, std::int64_t elapsed_ns) HAPTIC_RT {
    Result result;
    result.contact.proxy = grip.position;
    // Free motion until the first frame.
    if (!have_frame_) {
        return result;
    }
    result.reported = std::exchange(reported_, false);
    result.body_work = std::exchange(body_work_, 0.0);
    // Ages. A publishing time in the future would keep the force of a dead simulation alive, and the age of a negative
    // one could overflow: neither later than the arrival nor negative.
    result.frame_sequence = frame().sequence;
    const std::int64_t latest_ns = std::max<std::int64_t>(received_ns_, 0);
    result.frame_age_ns = now_ns - std::clamp<std::int64_t>(frame().publish_time_ns, 0, latest_ns);
    result.state_age_ns =
        frame().state_sequence == 0 ? -1 : now_ns - std::clamp<std::int64_t>(frame().state_time_ns, 0, now_ns);
    // Stale after the configured time, or after kFreshSteps of a slower simulation's steps.
    result.stale = result.frame_age_ns > std::max(settings_.stale_after_ns, kFreshSteps * frame().step_ns);

    // Fade out while stale; blend from the last wrench when frames come back.
    const double dt = static_cast<double>(elapsed_ns);
    if (result.stale) {
        fade_ = std::max(0.0, fade_ - dt / static_cast<double>(settings_.fade_ns));
    } else if (fade_ < 1.0) {
        begin_blend();
        fade_ = 1.0;
    }
    blend_ = std::min(1.0, blend_ + dt / static_cast<double>(settings_.ramp_ns));
    // Contact of the frame, unless it has faded out completely.
    if (fade_ > 0.0) {
        render_frame({.pose = grip, .previous = last_grip_, .elapsed_s = have_grip_ ? 1e-9 * dt : 0.0}, now_ns,
                     elapsed_ns, result.contact);
        // fade * ((1 - blend) * old + blend * new)
        const double fade = smooth_step(fade_);
        const double blend = smooth_step(blend_);
        Wrench& wrench = result.contact.wrench;
        wrench.force = fade * (blend * wrench.force + (1.0 - blend) * blend_from_.force);
        wrench.torque = fade * (blend * wrench.torque + (1.0 - blend) * blend_from_.torque);
        result.contact.surface_power *= fade * blend;
        result.stiffness = (frame().flags & HAPTIC_FRAME_CLUTCHED) == 0 ? stiffness_ : 0.0;
        result.scale = fade * blend;
        result.stiffness_limited = stiffness_limited_;
    } else {
        have_springs_ = false;
    }
    if (!is_finite(result.contact.wrench)) {
        // Overflow, for example of an absurd stiffness: zero, and the next wrench must not blend from this one.
        result.contact.wrench = Wrench{};
        result.contact.stored = 0.0;
        result.contact.surface_power = 0.0;
        result.scale = 0.0;
        result.finite = false;
        follower_.restart();
        stiffness_from_ = kImmediately;
        have_springs_ = false;
    }
    // Start of the next blend, and the previous pose of the next displacement.
    last_ = result.contact.wrench;
    last_grip_ = grip;
    last_ns_ = now_ns;
    have_grip_ = true;
    return result;
}

}  // namespace haptic
