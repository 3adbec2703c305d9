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
// In place of the stiffness that was felt: the frame's is taken at once.
constexpr double kNone = -1.0;
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

/// The longest way of a particle relative to those of its planes whose bit is set; its own where there are none. A
/// surface whose plane has come to the end of its horizon moves on, as far as anybody knows.
double way_to_planes(const Vec3& way, const ProxyContact& particle, unsigned planes, double elapsed_s) HAPTIC_RT {
    double longest = planes == 0 ? glm::length(way) : 0.0;
    for (; planes != 0; planes &= planes - 1) {
        const ContactPlane& plane = particle.planes[std::countr_zero(planes)];
        longest = std::max(longest, glm::length(way - plane.velocity * elapsed_s * to_vec3(plane.normal)));
    }
    return longest;
}

/// The planes of a frame at an instant.
struct MovedPlanes {
    const ContactFrame* frame = nullptr;
    std::int64_t time_ns = 0;
    std::int64_t horizon_ns = 0;
    bool moving = false;
    Friction friction;
};

/// Adds up what one particle does; sums are divided by the number of particles later.
struct Sums {
    Contact contact;
    double free_way = 0.0;

    void add(const ProxyContact& particle, const MovedPlanes& at, double stiffness, const GripMotion& grip,
             const Mat3& turn, SurfaceGrip& surface_grip, bool first) HAPTIC_RT;
    void add_friction(const ProxyContact& particle, const MovedPlanes& at, double stiffness, const Vec3& offset,
                      const Vec3& lever, double part) HAPTIC_RT;
};

/// What comes to a particle in contact because it is held `offset` beside where it would slide. `part` of it acts: no
/// more than the normal force, less its damping, can hold.
void Sums::add_friction(const ProxyContact& particle, const MovedPlanes& at, double stiffness, const Vec3& offset,
                        const Vec3& lever, double part) HAPTIC_RT {
    const Vec3 spring = stiffness * offset;
    contact.wrench.force += part * spring;
    contact.wrench.torque += glm::cross(lever, part * spring);
    contact.spring.force += spring;
    contact.spring.torque += glm::cross(lever, spring);
    contact.stored += 0.5 * stiffness * glm::dot(offset, offset);
    if (at.moving) {
        contact.surface_power += glm::dot(spring, to_vec3(particle.surface_velocity));
    }
}

void Sums::add(const ProxyContact& particle, const MovedPlanes& at, double stiffness, const GripMotion& grip,
               const Mat3& turn, SurfaceGrip& surface_grip, bool first) HAPTIC_RT {
    const Vec3 offset = to_vec3(particle.rest_offset);
    const Vec3 lever = turn * offset;
    const Vec3 goal = grip.pose.position + lever;
    Vec3 way(0.0);
    if (grip.elapsed_s > 0.0) {
        way = goal - (grip.before.position + grip.before.orientation * offset);
    }
    std::array<HalfSpace, kMaxPlanes> planes{};
    const std::size_t plane_count = std::min<std::size_t>(particle.plane_count, kMaxPlanes);
    for (std::size_t k = 0; k < plane_count; ++k) {
        planes[k] = plane_at(particle.planes[k], at.frame->plane_time_ns, at.time_ns, at.horizon_ns);
    }
    const std::span<const HalfSpace> sent(planes.data(), plane_count);
    const LocalProxy proxy = project(goal, sent);
    const Vec3 carried = at.moving ? to_vec3(particle.surface_velocity) * grip.elapsed_s : Vec3(0.0);
    const Vec3 held = hold(proxy, goal, sent, at.friction, carried, surface_grip);
    if (first) {
        contact.proxy = surface_grip.held ? surface_grip.at : proxy.position;
    }
    contact.lever = std::max(contact.lever, glm::length(offset));
    const Vec3 apart = proxy.position - goal;
    const double depth = glm::length(apart);
    if (proxy.active == 0 || !(depth > 0.0)) {
        free_way += way_to_planes(way, particle, (1u << plane_count) - 1u, grip.elapsed_s);
        return;
    }
    ++contact.in_contact;
    const Vec3 n = apart / depth;
    const double speed = surface_speed(n, particle, proxy.active);
    double damping = 0.0;
    if (at.frame->damping > 0.0) {
        const Vec3 goal_velocity = grip.velocity.linear + glm::cross(grip.velocity.angular, lever);
        damping = at.frame->damping * (speed - glm::dot(goal_velocity, n));
    }
    const Vec3 spring = stiffness * apart;
    const double strength = std::max(0.0, stiffness * depth + damping);
    const Vec3 force = strength * n;
    contact.wrench.force += force;
    contact.wrench.torque += glm::cross(lever, force);
    contact.spring.force += spring;
    contact.spring.torque += glm::cross(lever, spring);
    contact.stored += 0.5 * stiffness * depth * depth;
    contact.depth += depth;
    const double before = contact.way;
    contact.way += way_to_planes(way, particle, proxy.active, grip.elapsed_s);
    if (at.moving) {
        contact.surface_power += stiffness * depth * speed;
        contact.surface_velocity += depth * speed * n;
    }
    if (surface_grip.held) {
        contact.way = std::max(contact.way, before + glm::length(way - carried));
        add_friction(particle, at, stiffness, held, lever,
                     stiffness > 0.0 ? std::min(1.0, strength / (stiffness * depth)) : 0.0);
    }
}

}  // namespace

Contact render(const ContactFrame& frame, double stiffness, const GripMotion& grip, std::int64_t time_ns,
               SurfaceGrips& grips) HAPTIC_RT {
    Sums sums;
    Contact& contact = sums.contact;
    contact.proxy = grip.pose.position;
    if (frame.proxy_count == 0 || (frame.flags & HAPTIC_FRAME_CLUTCHED) != 0) {
        grips.fill({});
        return contact;
    }
    const Mat3 turn = glm::mat3_cast(grip.pose.orientation);
    const auto horizon_ns = static_cast<std::int64_t>(kHorizonSteps * static_cast<double>(frame.step_ns));
    const MovedPlanes at{&frame,
                         time_ns,
                         horizon_ns,
                         move_still(frame, time_ns, horizon_ns),
                         {frame.static_friction, frame.dynamic_friction}};
    const std::size_t count = std::min<std::size_t>(frame.proxy_count, kMaxProxies);
    for (std::size_t i = 0; i < count; ++i) {
        sums.add(frame.proxies[i], at, stiffness, grip, turn, grips[i], i == 0);
    }
    const double part = 1.0 / static_cast<double>(count);
    if (contact.in_contact == 0) {
        contact.way = part * sums.free_way;
        return contact;
    }
    contact.surface_velocity /= contact.depth;
    for (Wrench* wrench : {&contact.wrench, &contact.spring}) {
        wrench->force *= part;
        wrench->torque *= part;
    }
    contact.stored *= part;
    contact.surface_power *= part;
    contact.depth *= part;
    contact.way *= part;
    contact.wrench.torque -=
        frame.rotational_damping * part * static_cast<double>(contact.in_contact) * grip.velocity.angular;
    return contact;
}

Contact render(const ContactFrame& frame, const Pose& grip, const Twist& velocity, std::int64_t time_ns) HAPTIC_RT {
    SurfaceGrips none{};
    return render(frame, frame.stiffness, {.pose = grip, .velocity = velocity, .before = grip}, time_ns, none);
}

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
        grips_.fill({});
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
    follower_.leap();
    stiffness_from_ = kNone;
}

void FrameRenderer::move_stiffness_on(std::int64_t elapsed_ns) HAPTIC_RT {
    stiffness_age_ns_ = std::min(stiffness_age_ns_ + elapsed_ns, frame().step_ns);
    const bool there = stiffness_from_ < 0.0 || stiffness_age_ns_ >= frame().step_ns;
    const double part = there ? 1.0 : static_cast<double>(stiffness_age_ns_) / static_cast<double>(frame().step_ns);
    stiffness_ = there ? frame().stiffness : stiffness_from_ + part * (frame().stiffness - stiffness_from_);
}

void FrameRenderer::render_frame(const GripMotion& grip, std::int64_t now_ns, std::int64_t elapsed_ns,
                                 Contact& contact) HAPTIC_RT {
    const double before = stiffness_;
    move_stiffness_on(elapsed_ns);
    contact = rt::render(frame(), stiffness_, grip, now_ns, grips_);
    contact.wrench = follower_.follow({.wrench = contact.wrench,
                                       .travel = stiffness_ * contact.way,
                                       .stiffening = std::fabs(stiffness_ - before) * contact.depth,
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
        stiffness_from_ = kNone;
    }
    last_ = result.contact.wrench;
    last_grip_ = grip;
    have_grip_ = true;
    return result;
}

}  // namespace haptic::rt
