#include "haptic/rt/renderer.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <span>

#include "haptic/rt/finite.hpp"
#include "haptic/rt/smooth.hpp"

namespace haptic::rt {
namespace {

// Planes move on for at most this share of the simulation's step: half a step of patience for a frame that is late.
constexpr double kHorizonSteps = 1.5;
// A frame is fresh for at least so many steps of a slow simulation.
constexpr std::int64_t kFreshSteps = 3;
// Time constant of what the surface's velocity adds to the force, in steps of the simulation.
constexpr double kPushSteps = 0.5;
// Below this determinant of the Gram matrix, active planes are nearly parallel and one stands for all.
constexpr double kParallel = 1e-9;

/// Speed of the surface along the unit vector n, m/s, positive toward the proxy. With n = sum w_k n_k over the active
/// planes, a point that rides on all of them moves along n at sum w_k v_k.
double surface_speed(const Vec3& n, const ProxyContact& contact, std::uint8_t active) HAPTIC_RT {
    if ((active & (active - 1u)) == 0) {
        return contact.planes[std::countr_zero(active)].velocity;  // n is its normal
    }
    Mat3 gram(1.0);
    Vec3 along(0.0);
    Vec3 speeds(0.0);
    int deepest = -1;
    for (int i = 0; i < static_cast<int>(kMaxPlanes); ++i) {
        if ((active & (1u << i)) == 0) {
            continue;
        }
        const Vec3 normal = to_vec3(contact.planes[i].normal);
        along[i] = glm::dot(normal, n);
        speeds[i] = contact.planes[i].velocity;
        for (int j = 0; j < i; ++j) {
            const bool both = (active & (1u << j)) != 0;
            gram[i][j] = gram[j][i] = both ? glm::dot(normal, to_vec3(contact.planes[j].normal)) : 0.0;
        }
        deepest = deepest < 0 || along[i] > along[deepest] ? i : deepest;
    }
    if (speeds == Vec3(0.0)) {
        return 0.0;  // resting surfaces are the rule, and need no inverse
    }
    if (std::fabs(glm::determinant(gram)) < kParallel) {
        return along[deepest] * speeds[deepest];
    }
    return glm::dot(glm::inverse(gram) * along, speeds);
}

/// Planes move on by their velocity only so far, and then stand.
bool move_still(const ContactFrame& frame, std::int64_t time_ns, std::int64_t horizon_ns) HAPTIC_RT {
    std::int64_t age_ns = 0;  // the times come from another process: their difference may not fit
    return !__builtin_sub_overflow(time_ns, frame.plane_time_ns, &age_ns) && age_ns <= horizon_ns;
}

}  // namespace

Contact render(const ContactFrame& frame, const Pose& grip, const Twist& velocity, std::int64_t time_ns,
               SurfacePush& push, double share) HAPTIC_RT {
    Contact contact;
    contact.proxy = grip.position;
    if (frame.proxy_count == 0 || (frame.flags & HAPTIC_FRAME_CLUTCHED) != 0) {
        push.fill(0.0);
        return contact;
    }
    const Mat3 turn = glm::mat3_cast(grip.orientation);
    const auto horizon_ns = static_cast<std::int64_t>(kHorizonSteps * static_cast<double>(frame.step_ns));
    const bool planes_move = move_still(frame, time_ns, horizon_ns);
    const std::size_t count = std::min<std::size_t>(frame.proxy_count, kMaxProxies);
    for (std::size_t i = 0; i < count; ++i) {
        const ProxyContact& particle = frame.proxies[i];
        const Vec3 lever = turn * to_vec3(particle.rest_offset);
        const Vec3 goal = grip.position + lever;

        std::array<HalfSpace, kMaxPlanes> planes{};
        const std::size_t plane_count = std::min<std::size_t>(particle.plane_count, kMaxPlanes);
        for (std::size_t k = 0; k < plane_count; ++k) {
            planes[k] = plane_at(particle.planes[k], frame.plane_time_ns, time_ns, horizon_ns);
        }
        const LocalProxy proxy = project(goal, std::span<const HalfSpace>(planes.data(), plane_count));
        if (i == 0) {
            contact.proxy = proxy.position;
        }
        const Vec3 apart = proxy.position - goal;
        const double depth = glm::length(apart);
        if (proxy.active == 0 || !(depth > 0.0)) {
            push[i] = 0.0;
            continue;
        }
        ++contact.in_contact;
        const Vec3 n = apart / depth;
        const double speed = surface_speed(n, particle, proxy.active);
        double surface_push = 0.0;
        double brake = 0.0;
        if (frame.damping > 0.0) {
            const Vec3 goal_velocity = velocity.linear + glm::cross(velocity.angular, lever);
            surface_push = frame.damping * speed;
            brake = frame.damping * glm::dot(goal_velocity, n);
        }
        push[i] += share * (surface_push - push[i]);
        const double strength = frame.stiffness * depth + push[i] - brake;
        const Vec3 force = std::max(0.0, strength) * n;
        contact.stored += 0.5 * frame.stiffness * depth * depth;
        contact.surface_power += planes_move ? std::max(0.0, strength) * speed : 0.0;
        contact.wrench.force += force;
        contact.wrench.torque += glm::cross(lever, force);
    }
    if (contact.in_contact > 0) {
        const double part = 1.0 / static_cast<double>(count);
        contact.wrench.force *= part;
        contact.wrench.torque *= part;
        contact.stored *= part;
        contact.surface_power *= part;
        contact.wrench.torque -=
            frame.rotational_damping * part * static_cast<double>(contact.in_contact) * velocity.angular;
    }
    return contact;
}

Contact render(const ContactFrame& frame, const Pose& grip, const Twist& velocity, std::int64_t time_ns) HAPTIC_RT {
    SurfacePush push{};
    return render(frame, grip, velocity, time_ns, push, 1.0);
}

FrameDefect FrameRenderer::accept(std::int64_t now_ns) HAPTIC_RT {
    const ContactFrame& candidate = inbox();
    const FrameDefect defect = find_defect(candidate);
    if (defect != FrameDefect::None) {
        return defect;
    }
    const bool clutch_worked = ((candidate.flags ^ frame().flags) & HAPTIC_FRAME_CLUTCHED) != 0;
    if (have_frame_ && (candidate.session != frame().session || clutch_worked)) {
        begin_blend();
    }
    current_ = 1 - current_;
    ContactFrame& taken = frames_[current_];
    stiffness_limited_[current_] = taken.stiffness > settings_.largest_stiffness;
    taken.stiffness = std::min(taken.stiffness, settings_.largest_stiffness);
    have_frame_ = true;
    received_ns_ = now_ns;
    return FrameDefect::None;
}

void FrameRenderer::begin_blend() HAPTIC_RT {
    blend_from_ = last_;
    blend_ = 0.0;
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
        const double follow = dt / (dt + kPushSteps * static_cast<double>(frame().step_ns));
        result.contact = rt::render(frame(), grip, velocity, now_ns, push_, follow);
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
        push_.fill(0.0);
    }
    last_ = result.contact.wrench;
    return result;
}

}  // namespace haptic::rt
