#include "rendering/tool_contact.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <span>

#include "rendering/local_proxy.hpp"

namespace haptic::rt {
namespace {

// Planes move on for at most this share of the simulation's step: half a step of patience for a frame that is late.
constexpr double kHorizonSteps = 1.5;
// Below this determinant of the Gram matrix, active planes are nearly parallel and one stands for all.
constexpr double kParallel = 1e-9;
// s, time constant with which the place where a particle sticks goes to the simulation's.
constexpr double kDrawS = 0.1;
// Of the way of a row's depth, that the offset of springs in series goes at most (series_springs.hpp): the largest
// value of s / (1 + s^2), for singular values s of the rows.
constexpr double kSeriesGain = 0.5;

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
    double square = planes == 0 ? glm::dot(way, way) : 0.0;
    for (; planes != 0; planes &= planes - 1) {
        const ContactPlane& plane = particle.planes[std::countr_zero(planes)];
        const Vec3 relative = way - plane.velocity * elapsed_s * to_vec3(plane.normal);
        square = std::max(square, glm::dot(relative, relative));
    }
    return std::sqrt(square);
}

/// One particle at an instant. Made by Tool::place(), and left uninitialised before, because a tool has many.
struct Particle {
    const ProxyContact* sent;
    Vec3 lever;    // m, from the grip
    Vec3 way;      // m, of the goal since the last tick
    Vec3 apart;    // m, from the goal to the proxy; zero where nothing holds it
    Vec3 held;     // m, how far beside the proxy friction holds it
    Vec3 carried;  // m, how far its surface took it since the last tick
    std::size_t plane_count;
    std::uint8_t active;  // planes
    bool sticks;
};
using Planes = std::array<HalfSpace, kMaxPlanes>;

/// What the springs do to a particle.
struct Load {
    Vec3 normal{0.0};
    double size = 0.0;      // m, of a spring alone that would push as much
    double speed = 0.0;     // m/s, of the surface along the normal
    double damping = 0.0;   // N*s/m
    double friction = 0.0;  // N/m, of the spring to where friction holds it
};

/// The frame at an instant, and the sums over its particles.
class Tool {
  public:
    Tool(const ContactFrame& frame, const Stiffness& stiffness, const GripMotion& grip, std::int64_t time_ns) HAPTIC_RT
        : frame_(&frame),
          stiffness_(stiffness),
          grip_(grip),
          turn_(glm::mat3_cast(grip.pose.orientation)),
          turn_before_(glm::mat3_cast(grip.before.orientation)),
          count_(std::min<std::size_t>(frame.proxy_count, kMaxProxies)),
          time_ns_(time_ns),
          horizon_ns_(static_cast<std::int64_t>(kHorizonSteps* static_cast<double>(frame.step_ns))),
          moving_(!holds_positions() && move_still(frame, time_ns, horizon_ns_)) {}

    [[nodiscard]] Contact divided(ToolMemory& memory) HAPTIC_RT;
    [[nodiscard]] Contact in_series(ToolMemory& memory) HAPTIC_RT;
    [[nodiscard]] bool series() const HAPTIC_RT { return (frame_->flags & HAPTIC_FRAME_SERIES_SPRINGS) != 0; }

  private:
    [[nodiscard]] bool holds_positions() const HAPTIC_RT { return (frame_->flags & HAPTIC_FRAME_HOLD_POSITIONS) != 0; }
    void draw_to_frame(const ProxyContact& sent, SurfaceGrip& surface_grip) const HAPTIC_RT;
    [[nodiscard]] Particle place(std::size_t i, SurfaceGrip& surface_grip, Planes& planes) HAPTIC_RT;
    void add(const Particle& particle, const Load& load, double torque_ratio) HAPTIC_RT;
    void add_free(const Particle& particle) HAPTIC_RT {
        if (contact_.in_contact > 0) {
            return;  // it counts only where nothing is touched
        }
        free_way_ += way_to_planes(particle.way, *particle.sent, (1u << particle.plane_count) - 1u, grip_.elapsed_s);
    }

    const ContactFrame* frame_;
    Stiffness stiffness_;
    GripMotion grip_;
    Mat3 turn_;
    Mat3 turn_before_;
    std::size_t count_;
    std::int64_t time_ns_;
    std::int64_t horizon_ns_;
    bool moving_;
    Contact contact_;
    double free_way_ = 0.0;
    double squares_ = 0.0;  // m^2, sum |o_i|^2
    double longest_ = 0.0;  // m^2, of them
};

/// Both processes let a particle stick where each of them found it touching, and then carry it along with the surface
/// by themselves: the two places are not the same, and drift apart. While both say that it sticks, it is the
/// simulation's that counts, because the object is held there. What the hand feels of that is bounded like all else
/// that contradicts the last frame.
void Tool::draw_to_frame(const ProxyContact& sent, SurfaceGrip& surface_grip) const HAPTIC_RT {
    std::int64_t age_ns = 0;
    if (!surface_grip.held || surface_grip.slides || (sent.in_contact & HAPTIC_PROXY_STICKS) == 0 ||
        __builtin_sub_overflow(time_ns_, frame_->plane_time_ns, &age_ns)) {
        return;
    }
    const double moved_s = seconds(std::clamp<std::int64_t>(age_ns, 0, horizon_ns_));
    const Vec3 there = to_vec3(sent.position) + moved_s * to_vec3(sent.surface_velocity);
    surface_grip.at += grip_.elapsed_s / (grip_.elapsed_s + kDrawS) * (there - surface_grip.at);
}

Particle Tool::place(std::size_t i, SurfaceGrip& surface_grip, Planes& planes) HAPTIC_RT {
    const ProxyContact& sent = frame_->proxies[i];
    const Vec3 offset = to_vec3(sent.rest_offset);
    const Vec3 lever = turn_ * offset;
    const Vec3 goal = grip_.pose.position + lever;
    Vec3 way(0.0);
    if (grip_.elapsed_s > 0.0) {
        way = goal - (grip_.before.position + turn_before_ * offset);
    }
    const double square = glm::dot(offset, offset);
    squares_ += square;
    longest_ = std::max(longest_, square);
    Particle particle{&sent, lever, way, Vec3(0.0), Vec3(0.0), Vec3(0.0), 0, 0, false};
    if (holds_positions()) {
        if ((sent.in_contact & HAPTIC_PROXY_TOUCHES) != 0) {
            particle.apart = to_vec3(sent.position) - goal;
            particle.active = 1;
        }
        surface_grip = {};
    } else {
        particle.plane_count = std::min<std::size_t>(sent.plane_count, kMaxPlanes);
        for (std::size_t k = 0; k < particle.plane_count; ++k) {
            planes[k] = plane_at(sent.planes[k], frame_->plane_time_ns, time_ns_, horizon_ns_);
        }
        const std::span<const HalfSpace> used = std::span(planes).first(particle.plane_count);
        const LocalProxy proxy = project(goal, used);
        particle.apart = proxy.position - goal;
        particle.active = proxy.active;
        if (moving_) {
            particle.carried = to_vec3(sent.surface_velocity) * grip_.elapsed_s;
        }
        draw_to_frame(sent, surface_grip);
        particle.held = hold(proxy, goal, used, {frame_->static_friction, frame_->dynamic_friction}, particle.carried,
                             surface_grip);
        particle.sticks = surface_grip.held;
    }
    if (i == 0) {
        contact_.proxy = surface_grip.held ? surface_grip.at : goal + particle.apart;
    }
    return particle;
}

void Tool::add(const Particle& particle, const Load& load, double torque_ratio) HAPTIC_RT {
    const Vec3& n = load.normal;
    double damping = 0.0;
    if (load.damping > 0.0) {
        const Vec3 goal_velocity = grip_.velocity.linear + glm::cross(grip_.velocity.angular, particle.lever);
        damping = load.damping * (load.speed - glm::dot(goal_velocity, n));
    }
    const double pressed = stiffness_.force * load.size;
    const double strength = std::max(0.0, pressed + damping);
    const Vec3 force = strength * n;
    const Vec3 spring = pressed * n;
    // What the damping adds is the same force where it makes the torque.
    contact_.wrench.force += force;
    contact_.wrench.torque += glm::cross(particle.lever, std::max(0.0, torque_ratio * pressed + damping) * n);
    contact_.spring.force += spring;
    contact_.spring.torque += glm::cross(particle.lever, torque_ratio * spring);
    contact_.depth += load.size;
    if (moving_) {
        contact_.surface_power += pressed * load.speed;
        contact_.surface_velocity += load.size * load.speed * n;
    }
    if (!particle.sticks) {
        return;
    }
    // No more than the normal force, less its damping, can hold.
    const double part = pressed > 0.0 ? std::min(1.0, strength / pressed) : 0.0;
    const Vec3 beside = load.friction * particle.held;
    contact_.wrench.force += part * beside;
    contact_.wrench.torque += glm::cross(particle.lever, part * torque_ratio * beside);
    contact_.spring.force += beside;
    contact_.spring.torque += glm::cross(particle.lever, torque_ratio * beside);
    contact_.stored += 0.5 * std::max(1.0, torque_ratio) * load.friction * glm::dot(particle.held, particle.held);
    if (moving_) {
        contact_.surface_power += glm::dot(beside, to_vec3(particle.sent->surface_velocity));
    }
}

Contact Tool::divided(ToolMemory& memory) HAPTIC_RT {
    Planes planes{};
    const double torque_ratio = stiffness_.force > 0.0 ? stiffness_.torque / stiffness_.force : 1.0;
    for (std::size_t i = 0; i < count_; ++i) {
        const Particle particle = place(i, memory.grips[i], planes);
        const double depth = glm::length(particle.apart);
        if (particle.active == 0 || !(depth > 0.0)) {
            add_free(particle);
            continue;
        }
        ++contact_.in_contact;
        const Vec3 n = particle.apart / depth;
        const double speed = holds_positions() ? 0.0 : surface_speed(n, *particle.sent, particle.active);
        add(particle, {n, depth, speed, frame_->damping, stiffness_.force}, torque_ratio);
        contact_.stored += 0.5 * std::max(stiffness_.force, stiffness_.torque) * depth * depth;
        const unsigned holding = holds_positions() ? 0u : particle.active;
        double way = way_to_planes(particle.way, *particle.sent, holding, grip_.elapsed_s);
        if (particle.sticks) {
            way = std::max(way, glm::length(particle.way - particle.carried));
        }
        contact_.way += way;
    }
    contact_.lever = std::sqrt(longest_);
    const double part = 1.0 / static_cast<double>(count_);
    if (contact_.in_contact == 0) {
        contact_.way = part * free_way_;
        return contact_;
    }
    contact_.surface_velocity /= contact_.depth;
    for (Wrench* wrench : {&contact_.wrench, &contact_.spring}) {
        wrench->force *= part;
        wrench->torque *= part;
    }
    contact_.stored *= part;
    contact_.surface_power *= part;
    contact_.depth *= part;
    contact_.way *= part;
    contact_.wrench.torque -=
        frame_->rotational_damping * part * static_cast<double>(contact_.in_contact) * grip_.velocity.angular;
    return contact_;
}

Contact Tool::in_series(ToolMemory& memory) HAPTIC_RT {
    std::array<Particle, kMaxProxies> particles;           // NOLINT(*-member-init): filled below
    std::array<std::size_t, kMaxProxies + 1> first_row{};  // of each particle; the last one: of none
    std::span<SpringRow> rows = memory.rows;
    Planes planes{};
    std::size_t row_count = 0;
    for (std::size_t i = 0; i < count_; ++i) {
        const Particle& particle = particles[i] = place(i, memory.grips[i], planes);
        first_row[i] = row_count;
        const double depth = glm::length(particle.apart);
        if (holds_positions() && depth > 0.0) {
            rows[row_count++] = {particle.lever, particle.apart / depth, depth};
        }
        const Vec3 goal = grip_.pose.position + particle.lever;
        for (const HalfSpace& plane : std::span(planes).first(particle.plane_count)) {
            rows[row_count++] = {particle.lever, plane.normal, plane.offset - glm::dot(plane.normal, goal)};
        }
    }
    first_row[count_] = row_count;
    rows = rows.first(row_count);
    const Wrench pushed = memory.springs.solve(rows, {stiffness_.force, stiffness_.torque, gyration(squares_, count_)});
    double pushes = 0.0;  // N
    for (const SpringRow& row : rows) {
        pushes += row.push;
    }
    Vec3 moments(0.0);
    double squared_ways = 0.0;
    for (std::size_t i = 0; i < count_; ++i) {
        const Particle& particle = particles[i];
        Vec3 force(0.0);
        double power = 0.0;  // W, of its surfaces
        double own = 0.0;    // N, sum of its pushes
        unsigned pushing = 0;
        for (std::size_t r = first_row[i]; r < first_row[i + 1]; ++r) {
            const SpringRow& row = rows[r];
            const auto plane = static_cast<unsigned>(r - first_row[i]);
            if (row.push > 0.0) {
                force += row.push * row.normal;
                own += row.push;
                power += holds_positions() ? 0.0 : row.push * particle.sent->planes[plane].velocity;
                pushing |= 1u << plane;
            }
        }
        const double strength = glm::length(force);
        if (!(strength > 0.0)) {
            add_free(particle);
            continue;
        }
        ++contact_.in_contact;
        const double depth = glm::length(particle.apart);
        const double size = strength / stiffness_.force;
        const Load load{force / strength, size, power / strength, frame_->damping * own / pushes,
                        depth > 0.0 ? stiffness_.force * size / depth : 0.0};
        add(particle, load, 1.0);
        moments += glm::cross(particle.lever, stiffness_.force * load.size * load.normal);
        double way = way_to_planes(particle.way, *particle.sent, holds_positions() ? 0u : pushing, grip_.elapsed_s);
        if (particle.sticks) {
            way = std::max(way, glm::length(particle.way - particle.carried));
        }
        squared_ways += way * way;
    }
    contact_.lever = std::sqrt(longest_);
    if (contact_.in_contact == 0) {
        contact_.way = free_way_ / static_cast<double>(count_);
        return contact_;
    }
    contact_.surface_velocity /= contact_.depth;
    contact_.stored += memory.springs.stored();
    contact_.way = kSeriesGain * std::sqrt(squared_ways);
    contact_.wrench.torque += pushed.torque - moments;
    contact_.spring.torque += pushed.torque - moments;
    const auto touching = static_cast<double>(contact_.in_contact);
    contact_.wrench.torque -= frame_->rotational_damping * touching / (1.0 + touching) * grip_.velocity.angular;
    return contact_;
}

}  // namespace

double square_lever(const ContactFrame& frame) HAPTIC_RT {
    double squares = 0.0;
    const std::size_t count = std::min<std::size_t>(frame.proxy_count, kMaxProxies);
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3 offset = to_vec3(frame.proxies[i].rest_offset);
        squares += glm::dot(offset, offset);
    }
    if ((frame.flags & HAPTIC_FRAME_SERIES_SPRINGS) != 0) {
        const double rho = gyration(squares, count);
        return rho * rho;
    }
    return count > 0 ? squares / static_cast<double>(count) : 0.0;
}

Contact render(const ContactFrame& frame, const Stiffness& stiffness, const GripMotion& grip, std::int64_t time_ns,
               ToolMemory& memory) HAPTIC_RT {
    if (frame.proxy_count == 0 || (frame.flags & HAPTIC_FRAME_CLUTCHED) != 0) {
        memory.grips.fill({});
        Contact none;
        none.proxy = grip.pose.position;
        return none;
    }
    Tool tool(frame, stiffness, grip, time_ns);
    return tool.series() ? tool.in_series(memory) : tool.divided(memory);
}

Contact render(const ContactFrame& frame, const Pose& grip, const Twist& velocity, std::int64_t time_ns) HAPTIC_RT {
    ToolMemory none;
    return render(frame, stiffness_of(frame), {.pose = grip, .velocity = velocity, .before = grip}, time_ns, none);
}

}  // namespace haptic::rt
