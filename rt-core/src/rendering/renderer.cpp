#include "rendering/renderer.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "haptic/numeric.hpp"

namespace haptic::rt {
namespace {

// Minimum number of simulation steps for which a frame is fresh; decisive for slow simulations.
constexpr std::int64_t kFreshSteps = 3;
// As a starting stiffness: no interpolation, the frame's stiffness applies at once.
constexpr double kImmediately = -1.0;

}  // namespace

FrameDefect FrameRenderer::accept(std::int64_t now_ns) HAPTIC_RT {
    // A defective frame is rejected and changes nothing.
    const ContactFrame& candidate = inbox();
    const FrameDefect defect = find_defect(candidate);
    if (defect != FrameDefect::None) {
        return defect;
    }
    // Interpolate the stiffness from the present one; blend where continuity cannot be expected.
    stiffness_from_ = stiffness_;
    stiffness_age_ns_ = 0;
    const bool clutch_changed = ((candidate.flags ^ frame().flags) & HAPTIC_FRAME_CLUTCHED) != 0;
    if (have_frame_ && (candidate.session != frame().session || clutch_changed)) {
        begin_blend();
    }
    // Another tool: its particles have no friction state yet.
    if (candidate.session != frame().session || candidate.proxy_count != frame().proxy_count) {
        memory_.friction.fill({});
    }
    // Swap inbox and current frame.
    current_ = 1 - current_;
    limit_stiffness();
    have_frame_ = true;
    received_ns_ = now_ns;
    return FrameDefect::None;
}

void FrameRenderer::limit_stiffness() HAPTIC_RT {
    // Translational limit, then the rotational one, k_t <o^2> <= limit.
    const Stiffness requested = stiffness_of(frame());
    const double squared_arm = squared_moment_arm(frame());
    Stiffness& allowed = coupling_[current_];
    allowed.force = std::min(requested.force, settings_.max_stiffness);
    allowed.torque = frame().torque_stiffness > 0.0 ? requested.torque : allowed.force;
    if (allowed.torque * squared_arm > settings_.max_rotational_stiffness) {
        allowed.torque = settings_.max_rotational_stiffness / squared_arm;
    }
    stiffness_limited_[current_] = allowed.force < requested.force || allowed.torque < requested.torque;
}

void FrameRenderer::begin_blend() HAPTIC_RT {
    blend_from_ = last_;
    blend_ = 0.0;
    follower_.restart();
    stiffness_from_ = {kImmediately, kImmediately};
}

void FrameRenderer::interpolate_stiffness(std::int64_t elapsed_ns) HAPTIC_RT {
    const Stiffness& to = coupling_[current_];
    stiffness_age_ns_ = std::min(stiffness_age_ns_ + elapsed_ns, frame().step_ns);
    if (stiffness_from_.force < 0.0 || stiffness_age_ns_ >= frame().step_ns) {
        stiffness_ = to;
        return;
    }
    // Linear over one step of the simulation.
    const double part = static_cast<double>(stiffness_age_ns_) / static_cast<double>(frame().step_ns);
    stiffness_.force = stiffness_from_.force + part * (to.force - stiffness_from_.force);
    stiffness_.torque = stiffness_from_.torque + part * (to.torque - stiffness_from_.torque);
}

void FrameRenderer::render_frame(const GripMotion& grip, std::int64_t now_ns, std::int64_t elapsed_ns,
                                 Contact& contact) HAPTIC_RT {
    // Contact at this tick's stiffness.
    const Stiffness before = stiffness_;
    interpolate_stiffness(elapsed_ns);
    contact = rt::render(frame(), stiffness_, grip, now_ns, memory_);
    if ((frame().flags & HAPTIC_FRAME_HOLD_POSITIONS) != 0) {
        follower_.restart();  // the thesis' scheme is rendered unchanged, including its discontinuities
    }
    // Springs in series couple the depth of one particle to the orientation of all, with the geometric mean of the two
    // stiffnesses.
    const double torque_stiffness = std::max(stiffness_.torque, std::sqrt(stiffness_.force * stiffness_.torque));
    // Follow the frame's wrench within the bound of wrench_follower.hpp.
    const Stiffness change{std::fabs(stiffness_.force - before.force), std::fabs(stiffness_.torque - before.torque)};
    contact.wrench = follower_.follow({.wrench = contact.wrench,
                                       .force_of_motion = stiffness_.force * contact.displacement,
                                       .torque_of_motion = torque_stiffness * contact.displacement,
                                       .force_of_stiffness = change.force * contact.depth,
                                       .torque_of_stiffness = change.torque * contact.depth,
                                       .max_moment_arm = contact.max_moment_arm,
                                       .in_contact = contact.in_contact > 0},
                                      1e-9 * static_cast<double>(elapsed_ns));
    // Power of the moving surfaces, for the passivity observer: power at the springs, plus power of the difference
    // between rendered and spring force, which is due to damping and the follower. An approaching surface works against
    // the rendered force. A receding one takes at most the power of the springs: with the hand at rest nothing else
    // leaves them.
    const double spring_power = contact.surface_power;
    const double power = spring_power + glm::dot(contact.wrench.force - contact.spring.force, contact.surface_velocity);
    contact.surface_power = power >= 0.0 ? power : std::min(0.0, std::max(power, spring_power));
}

FrameRenderer::Result FrameRenderer::render(const Pose& grip, const Twist& velocity, std::int64_t now_ns,
                                            std::int64_t elapsed_ns) HAPTIC_RT {
    Result result;
    result.contact.proxy = grip.position;
    // Free motion until the first frame.
    if (!have_frame_) {
        return result;
    }
    // Ages. A publishing time in the future would keep the force of a dead simulation alive, hence the minimum.
    result.frame_sequence = frame().sequence;
    result.frame_age_ns = now_ns - std::min(frame().publish_time_ns, received_ns_);
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
        render_frame(
            {.pose = grip, .velocity = velocity, .previous = last_grip_, .elapsed_s = have_grip_ ? 1e-9 * dt : 0.0},
            now_ns, elapsed_ns, result.contact);
        // fade * ((1 - blend) * old + blend * new)
        const double fade = smooth_step(fade_);
        const double blend = smooth_step(blend_);
        Wrench& wrench = result.contact.wrench;
        wrench.force = fade * (blend * wrench.force + (1.0 - blend) * blend_from_.force);
        wrench.torque = fade * (blend * wrench.torque + (1.0 - blend) * blend_from_.torque);
        result.contact.surface_power *= fade * blend;
        result.stiffness_limited = stiffness_limited_[current_];
    }
    if (!is_finite(result.contact.wrench)) {
        // Overflow, for example of an absurd stiffness: zero, and the next wrench must not blend from this one.
        result.contact.wrench = Wrench{};
        result.contact.stored = 0.0;
        result.contact.surface_power = 0.0;
        result.finite = false;
        follower_.restart();
        stiffness_from_ = {kImmediately, kImmediately};
    }
    // Start of the next blend, and the previous pose of the next displacement.
    last_ = result.contact.wrench;
    last_grip_ = grip;
    have_grip_ = true;
    return result;
}

}  // namespace haptic::rt
