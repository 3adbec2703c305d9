#include "rendering/renderer.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include <haptic/rt/finite.hpp>
#include <haptic/rt/smooth.hpp>

namespace haptic::rt {
namespace {

// A frame is fresh for at least so many steps of a slow simulation.
constexpr std::int64_t kFreshSteps = 3;
// In place of the stiffness that was felt: the frame's is taken at once.
constexpr double kNone = -1.0;

}  // namespace

FrameDefect FrameRenderer::accept(std::int64_t now_ns) HAPTIC_RT {
    const ContactFrame& candidate = inbox();
    const FrameDefect defect = find_defect(candidate);
    if (defect != FrameDefect::None) {
        return defect;
    }
    stiffness_from_ = stiffness_;
    stiffness_age_ns_ = 0;
    const bool clutch_worked = ((candidate.flags ^ frame().flags) & HAPTIC_FRAME_CLUTCHED) != 0;
    if (have_frame_ && (candidate.session != frame().session || clutch_worked)) {
        begin_blend();
    }
    if (candidate.session != frame().session || candidate.proxy_count != frame().proxy_count) {
        memory_.grips.fill({});
    }
    current_ = 1 - current_;
    limit_stiffness();
    have_frame_ = true;
    received_ns_ = now_ns;
    return FrameDefect::None;
}

void FrameRenderer::limit_stiffness() HAPTIC_RT {
    const Stiffness asked = stiffness_of(frame());
    const double lever = square_lever(frame());
    Stiffness& allowed = coupling_[current_];
    allowed.force = std::min(asked.force, settings_.largest_stiffness);
    allowed.torque = frame().torque_stiffness > 0.0 ? asked.torque : allowed.force;
    if (allowed.torque * lever > settings_.largest_rotational_stiffness) {
        allowed.torque = settings_.largest_rotational_stiffness / lever;
    }
    stiffness_limited_[current_] = allowed.force < asked.force || allowed.torque < asked.torque;
}

void FrameRenderer::begin_blend() HAPTIC_RT {
    blend_from_ = last_;
    blend_ = 0.0;
    follower_.leap();
    stiffness_from_ = {kNone, kNone};
}

void FrameRenderer::move_stiffness_on(std::int64_t elapsed_ns) HAPTIC_RT {
    const Stiffness& to = coupling_[current_];
    stiffness_age_ns_ = std::min(stiffness_age_ns_ + elapsed_ns, frame().step_ns);
    if (stiffness_from_.force < 0.0 || stiffness_age_ns_ >= frame().step_ns) {
        stiffness_ = to;
        return;
    }
    const double part = static_cast<double>(stiffness_age_ns_) / static_cast<double>(frame().step_ns);
    stiffness_.force = stiffness_from_.force + part * (to.force - stiffness_from_.force);
    stiffness_.torque = stiffness_from_.torque + part * (to.torque - stiffness_from_.torque);
}

void FrameRenderer::render_frame(const GripMotion& grip, std::int64_t now_ns, std::int64_t elapsed_ns,
                                 Contact& contact) HAPTIC_RT {
    const Stiffness before = stiffness_;
    move_stiffness_on(elapsed_ns);
    contact = rt::render(frame(), stiffness_, grip, now_ns, memory_);
    if ((frame().flags & HAPTIC_FRAME_HOLD_POSITIONS) != 0) {
        follower_.leap();  // the thesis' scheme is felt as it is, seams and all
    }
    // Springs in series pass on to one attitude what others' depths do, with the geometric mean of the two.
    const double torque_stiffness = std::max(stiffness_.torque, std::sqrt(stiffness_.force * stiffness_.torque));
    const Stiffness change{std::fabs(stiffness_.force - before.force), std::fabs(stiffness_.torque - before.torque)};
    contact.wrench = follower_.follow({.wrench = contact.wrench,
                                       .travel = stiffness_.force * contact.way,
                                       .torque_travel = torque_stiffness * contact.way,
                                       .stiffening = change.force * contact.depth,
                                       .torque_stiffening = change.torque * contact.depth,
                                       .lever = contact.lever,
                                       .in_contact = contact.in_contact > 0},
                                      1e-9 * static_cast<double>(elapsed_ns));
    // A surface that comes works with what is felt. One that goes takes no more than it left in the springs: while the
    // hand is still nothing leaves them otherwise.
    const double of_springs = contact.surface_power;
    const double felt = of_springs + glm::dot(contact.wrench.force - contact.spring.force, contact.surface_velocity);
    contact.surface_power = felt >= 0.0 ? felt : std::min(0.0, std::max(felt, of_springs));
}

FrameRenderer::Result FrameRenderer::render(const Pose& grip, const Twist& velocity, std::int64_t now_ns,
                                            std::int64_t elapsed_ns) HAPTIC_RT {
    Result result;
    result.contact.proxy = grip.position;
    if (!have_frame_) {
        return result;
    }
    // A time of publishing in our future would keep a dead simulation's force alive.
    result.frame_sequence = frame().sequence;
    result.frame_age_ns = now_ns - std::min(frame().publish_time_ns, received_ns_);
    result.state_age_ns =
        frame().state_sequence == 0 ? -1 : now_ns - std::clamp<std::int64_t>(frame().state_time_ns, 0, now_ns);
    result.stale = result.frame_age_ns > std::max(settings_.stale_after_ns, kFreshSteps * frame().step_ns);

    const double dt = static_cast<double>(elapsed_ns);
    if (result.stale) {
        fade_ = std::max(0.0, fade_ - dt / static_cast<double>(settings_.fade_ns));
    } else if (fade_ < 1.0) {
        begin_blend();
        fade_ = 1.0;
    }
    blend_ = std::min(1.0, blend_ + dt / static_cast<double>(settings_.ramp_ns));
    if (fade_ > 0.0) {
        render_frame(
            {.pose = grip, .velocity = velocity, .before = last_grip_, .elapsed_s = have_grip_ ? 1e-9 * dt : 0.0},
            now_ns, elapsed_ns, result.contact);
        const double fade = smooth_step(fade_);
        const double taken = smooth_step(blend_);
        Wrench& wrench = result.contact.wrench;
        wrench.force = fade * (taken * wrench.force + (1.0 - taken) * blend_from_.force);
        wrench.torque = fade * (taken * wrench.torque + (1.0 - taken) * blend_from_.torque);
        result.contact.surface_power *= fade * taken;
        result.stiffness_limited = stiffness_limited_[current_];
    }
    if (!finite(result.contact.wrench)) {
        // A stiffness without measure; what is felt next must not blend from it.
        result.contact.wrench = Wrench{};
        result.contact.stored = 0.0;
        result.contact.surface_power = 0.0;
        result.finite = false;
        follower_.leap();
        stiffness_from_ = {kNone, kNone};
    }
    last_ = result.contact.wrench;
    last_grip_ = grip;
    have_grip_ = true;
    return result;
}

}  // namespace haptic::rt
