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

// Maximum number of simulation steps for which planes are extrapolated: half a step of margin for a late frame.
constexpr double kHorizonSteps = 1.5;
// Determinant of the normals' Gram matrix below which active planes count as parallel, and one represents all.
constexpr double kParallel = 1e-9;
// s, time constant with which a particle's sticking position moves to the simulation's.
constexpr double kStickCorrectionTimeS = 0.1;
// Largest displacement of the offset of springs in series per displacement of the rows' depths (series_springs.hpp):
// the maximum of s / (1 + s^2) over singular values s of the rows.
constexpr double kSeriesGain = 0.5;

/// m/s, speed of the surface along the unit vector n, positive towards the proxy. With n = sum w_k n_k over the active
/// planes, a point that stays on all of them moves along n at sum w_k v_k.
double surface_speed(const Vec3& n, const ProxyContact& contact, std::uint8_t active) HAPTIC_RT {
    if ((active & (active - 1u)) == 0) {
        return contact.planes[std::countr_zero(active)].velocity;  // a single active plane, whose normal is n
    }
    // Normal equations of n = sum w_k n_k. Rows of inactive planes stay those of the identity, with speed zero.
    Mat3 gram(1.0);
    Vec3 along(0.0);
    Vec3 speeds(0.0);
    int most_aligned = -1;
    for (int i = 0; i < static_cast<int>(kMaxPlanes); ++i) {
        if ((active & (1u << i)) == 0) {
            continue;
        }
        // Gram matrix G_ij = n_i . n_j, and the right-hand side n_i . n.
        const Vec3 normal = to_vec3(contact.planes[i].normal);
        along[i] = glm::dot(normal, n);
        speeds[i] = contact.planes[i].velocity;
        for (int j = 0; j < i; ++j) {
            const bool both = (active & (1u << j)) != 0;
            gram[i][j] = gram[j][i] = both ? glm::dot(normal, to_vec3(contact.planes[j].normal)) : 0.0;
        }
        most_aligned = most_aligned < 0 || along[i] > along[most_aligned] ? i : most_aligned;
    }
    if (speeds == Vec3(0.0)) {
        return 0.0;  // surfaces at rest, the usual case
    }
    // Weights w = G^-1 (n_i . n). Parallel planes make G singular; then the plane with the normal nearest to n decides.
    if (std::fabs(glm::determinant(gram)) < kParallel) {
        return along[most_aligned] * speeds[most_aligned];
    }
    return glm::dot(glm::inverse(gram) * along, speeds);
}

/// True while planes are extrapolated with their velocity; beyond the horizon they stand still.
bool planes_move(const ContactFrame& frame, std::int64_t time_ns, std::int64_t horizon_ns) HAPTIC_RT {
    std::int64_t age_ns = 0;  // the times come from another process: their difference may overflow
    return !__builtin_sub_overflow(time_ns, frame.plane_time_ns, &age_ns) && age_ns <= horizon_ns;
}

/// m, largest displacement of a particle relative to those of its planes whose bit is set; its own without planes. A
/// surface counts as moving even when its plane has reached the end of its horizon.
double relative_displacement(const Vec3& displacement, const ProxyContact& particle, unsigned planes,
                             double elapsed_s) HAPTIC_RT {
    // Without planes: the particle's own displacement.
    double square = planes == 0 ? glm::dot(displacement, displacement) : 0.0;
    for (; planes != 0; planes &= planes - 1) {
        const ContactPlane& plane = particle.planes[std::countr_zero(planes)];
        // Displacement relative to this plane, which moves along its normal.
        const Vec3 relative = displacement - plane.velocity * elapsed_s * to_vec3(plane.normal);
        square = std::max(square, glm::dot(relative, relative));
    }
    return std::sqrt(square);
}

/// One particle at an instant, filled by Tool::locate(). No initialisers on purpose: a tool has many particles.
struct Particle {
    const ProxyContact* sent;
    Vec3 moment_arm;            // m, R o_i: from the grip's origin
    Vec3 displacement;          // m, of the goal since the last tick
    Vec3 correction;            // m, d = x_i - g_i: from the goal to the proxy; zero without contact
    Vec3 friction_offset;       // m, t_i: from the frictionless proxy to where friction holds it
    Vec3 surface_displacement;  // m, of its surface since the last tick
    std::size_t plane_count;
    std::uint8_t active;  // bit k: plane k holds it
    bool has_friction;
};
using Planes = std::array<HalfSpace, kMaxPlanes>;

/// Spring, damper and friction of one particle.
struct Load {
    Vec3 normal{0.0};
    double depth = 0.0;     // m, |f_i| / k: depth of a single spring of the same force
    double speed = 0.0;     // m/s, of the surface along the normal
    double damping = 0.0;   // N*s/m
    double friction = 0.0;  // N/m, stiffness of the tangential spring
};

/// Evaluates a contact frame at an instant: the sums over its particles.
class Tool {
  public:
    Tool(const ContactFrame& frame, const Stiffness& stiffness, const GripMotion& grip, std::int64_t time_ns) HAPTIC_RT
        : frame_(&frame),
          stiffness_(stiffness),
          grip_(grip),
          rotation_(glm::mat3_cast(grip.pose.orientation)),
          previous_rotation_(glm::mat3_cast(grip.previous.orientation)),
          count_(std::min<std::size_t>(frame.proxy_count, kMaxProxies)),
          time_ns_(time_ns),
          horizon_ns_(static_cast<std::int64_t>(kHorizonSteps* static_cast<double>(frame.step_ns))),
          moving_(!holds_positions() && planes_move(frame, time_ns, horizon_ns_)) {}

    [[nodiscard]] Contact render_mean(ToolMemory& memory) HAPTIC_RT;
    [[nodiscard]] Contact render_in_series(ToolMemory& memory) HAPTIC_RT;
    [[nodiscard]] bool series() const HAPTIC_RT { return (frame_->flags & HAPTIC_FRAME_SERIES_SPRINGS) != 0; }

  private:
    [[nodiscard]] bool holds_positions() const HAPTIC_RT { return (frame_->flags & HAPTIC_FRAME_HOLD_POSITIONS) != 0; }
    void correct_stick_position(const ProxyContact& sent, FrictionState& friction) const HAPTIC_RT;
    [[nodiscard]] Particle locate(std::size_t i, FrictionState& friction, Planes& planes) HAPTIC_RT;
    void add_force(const Particle& particle, const Load& load, double torque_ratio) HAPTIC_RT;
    void add_free_displacement(const Particle& particle) HAPTIC_RT {
        if (contact_.in_contact > 0) {
            return;  // needed only if no particle is in contact
        }
        free_displacement_ += relative_displacement(particle.displacement, *particle.sent,
                                                    (1u << particle.plane_count) - 1u, grip_.elapsed_s);
    }

    const ContactFrame* frame_;
    Stiffness stiffness_;
    GripMotion grip_;
    Mat3 rotation_;
    Mat3 previous_rotation_;
    std::size_t count_;
    std::int64_t time_ns_;
    std::int64_t horizon_ns_;
    bool moving_;
    Contact contact_;
    double free_displacement_ = 0.0;
    double squares_ = 0.0;     // m^2, sum |o_i|^2
    double max_square_ = 0.0;  // m^2, largest |o_i|^2
};

/// Moves the sticking position towards the simulation's. Each process lets a particle stick where it found it touching,
/// and carries it along with the surface on its own, so the two positions differ and drift. While both report sticking,
/// the simulation's position is the right one, because it holds the object there. The WrenchFollower bounds what the
/// hand feels of this.
void Tool::correct_stick_position(const ProxyContact& sent, FrictionState& friction) const HAPTIC_RT {
    // Only while both processes report sticking, and the frame's age does not overflow.
    std::int64_t age_ns = 0;
    if (!friction.in_contact || friction.sliding || (sent.in_contact & HAPTIC_PROXY_STICKS) == 0 ||
        __builtin_sub_overflow(time_ns_, frame_->plane_time_ns, &age_ns)) {
        return;
    }
    // The simulation's position, extrapolated with the surface to now; first-order low-pass towards it.
    const double moved_s = seconds(std::clamp<std::int64_t>(age_ns, 0, horizon_ns_));
    const Vec3 there = to_vec3(sent.position) + moved_s * to_vec3(sent.surface_velocity);
    friction.position += grip_.elapsed_s / (grip_.elapsed_s + kStickCorrectionTimeS) * (there - friction.position);
}

/// Goal, local proxy and friction of particle i at this instant; `planes` receives its extrapolated planes.
Particle Tool::locate(std::size_t i, FrictionState& friction, Planes& planes) HAPTIC_RT {
    const ProxyContact& sent = frame_->proxies[i];
    const Vec3 offset = to_vec3(sent.rest_offset);
    const Vec3 moment_arm = rotation_ * offset;
    // Eq. 5.1: g_i = R o_i + p, and its displacement since the last tick.
    const Vec3 goal = grip_.pose.position + moment_arm;
    Vec3 displacement(0.0);
    // Without a previous pose the displacement stays zero.
    if (grip_.elapsed_s > 0.0) {
        displacement = goal - (grip_.previous.position + previous_rotation_ * offset);
    }
    // Moment arms of the tool, for the radius of gyration and the follower's torque bound.
    const double square = glm::dot(offset, offset);
    squares_ += square;
    max_square_ = std::max(max_square_, square);
    Particle particle{&sent, moment_arm, displacement, Vec3(0.0), Vec3(0.0), Vec3(0.0), 0, 0, false};
    if (holds_positions()) {
        // The thesis' scheme (section 5.4.1): the proxy is where the frame has it.
        if ((sent.in_contact & HAPTIC_PROXY_TOUCHES) != 0) {
            particle.correction = to_vec3(sent.position) - goal;
            particle.active = 1;
        }
        friction = {};
    } else {
        // Planes at this tick's time, and the projection of the goal onto them.
        particle.plane_count = std::min<std::size_t>(sent.plane_count, kMaxPlanes);
        for (std::size_t k = 0; k < particle.plane_count; ++k) {
            planes[k] = plane_at(sent.planes[k], frame_->plane_time_ns, time_ns_, horizon_ns_);
        }
        const std::span<const HalfSpace> used = std::span(planes).first(particle.plane_count);
        const LocalProxy proxy = project(goal, used);
        particle.correction = proxy.position - goal;
        particle.active = proxy.active;
        // Friction offset from the frictionless proxy. A surface whose planes stand still carries no particle.
        if (moving_) {
            particle.surface_displacement = to_vec3(sent.surface_velocity) * grip_.elapsed_s;
        }
        correct_stick_position(sent, friction);
        particle.friction_offset =
            apply_friction(proxy, goal, used, {frame_->static_friction, frame_->dynamic_friction},
                           particle.surface_displacement, friction);
        particle.has_friction = friction.in_contact;
    }
    // The first particle's proxy is the one that is published.
    if (i == 0) {
        contact_.proxy = friction.in_contact ? friction.position : goal + particle.correction;
    }
    return particle;
}

/// Adds the wrench, energy and power of one particle in contact. The torque uses torque_ratio times the stiffness.
void Tool::add_force(const Particle& particle, const Load& load, double torque_ratio) HAPTIC_RT {
    const Vec3& n = load.normal;
    // Damping b (v_surface - v_goal) . n.
    double damping = 0.0;
    if (load.damping > 0.0) {
        const Vec3 goal_velocity = grip_.velocity.linear + glm::cross(grip_.velocity.angular, particle.moment_arm);
        damping = load.damping * (load.speed - glm::dot(goal_velocity, n));
    }
    // Normal force: f_i = max(0, k |d| + damping) n.
    const double spring_force = stiffness_.force * load.depth;
    const double normal_force = std::max(0.0, spring_force + damping);
    const Vec3 force = normal_force * n;
    const Vec3 spring = spring_force * n;
    // Torque about the grip: k_t in place of k for the spring, the same damping force.
    contact_.wrench.force += force;
    contact_.wrench.torque += glm::cross(particle.moment_arm, std::max(0.0, torque_ratio * spring_force + damping) * n);
    contact_.spring.force += spring;
    contact_.spring.torque += glm::cross(particle.moment_arm, torque_ratio * spring);
    // Sums for the wrench follower (depth) and the passivity observer (power and velocity of moving surfaces).
    contact_.depth += load.depth;
    if (moving_) {
        contact_.surface_power += spring_force * load.speed;
        contact_.surface_velocity += load.depth * load.speed * n;
    }
    if (!particle.has_friction) {
        return;
    }
    // Friction k t_i, reduced in proportion where damping reduces the normal force.
    const double part = spring_force > 0.0 ? std::min(1.0, normal_force / spring_force) : 0.0;
    // k t_i: force and torque, for the rendered wrench and for the springs without damping.
    const Vec3 tangential = load.friction * particle.friction_offset;
    contact_.wrench.force += part * tangential;
    contact_.wrench.torque += glm::cross(particle.moment_arm, part * torque_ratio * tangential);
    contact_.spring.force += tangential;
    contact_.spring.torque += glm::cross(particle.moment_arm, torque_ratio * tangential);
    // Its energy k |t_i|^2 / 2, and the power of a surface that drags the particle along.
    contact_.stored += 0.5 * std::max(1.0, torque_ratio) * load.friction *
                       glm::dot(particle.friction_offset, particle.friction_offset);
    if (moving_) {
        contact_.surface_power += glm::dot(tangential, to_vec3(particle.sent->surface_velocity));
    }
}

/// Section 5.2.2: independent springs, summed and divided by the number of all particles.
Contact Tool::render_mean(ToolMemory& memory) HAPTIC_RT {
    Planes planes{};
    // k_t / k scales every torque.
    const double torque_ratio = stiffness_.force > 0.0 ? stiffness_.torque / stiffness_.force : 1.0;
    for (std::size_t i = 0; i < count_; ++i) {
        // Only collided particles count. The others only contribute to the displacement of a free tool.
        const Particle particle = locate(i, memory.friction[i], planes);
        const double depth = glm::length(particle.correction);
        if (particle.active == 0 || !(depth > 0.0)) {
            add_free_displacement(particle);
            continue;
        }
        // Spring, damper and friction of a particle in contact.
        ++contact_.in_contact;
        const Vec3 n = particle.correction / depth;
        const double speed = holds_positions() ? 0.0 : surface_speed(n, *particle.sent, particle.active);
        add_force(particle, {n, depth, speed, frame_->damping, stiffness_.force}, torque_ratio);
        contact_.stored += 0.5 * std::max(stiffness_.force, stiffness_.torque) * depth * depth;
        // Its displacement relative to its active planes, and to the surface that it sticks to.
        const unsigned active_planes = holds_positions() ? 0u : particle.active;
        double displacement =
            relative_displacement(particle.displacement, *particle.sent, active_planes, grip_.elapsed_s);
        if (particle.has_friction) {
            displacement = std::max(displacement, glm::length(particle.displacement - particle.surface_displacement));
        }
        contact_.displacement += displacement;
    }
    // Mean over all N particles, in contact or not.
    contact_.max_moment_arm = std::sqrt(max_square_);
    const double part = 1.0 / static_cast<double>(count_);
    // No contact: the wrench is exactly zero, and the displacement is that of the free tool.
    if (contact_.in_contact == 0) {
        contact_.displacement = part * free_displacement_;
        return contact_;
    }
    contact_.surface_velocity /= contact_.depth;
    // Division by N, and the rotational damping -b_r omega (particles in contact) / N.
    for (Wrench* wrench : {&contact_.wrench, &contact_.spring}) {
        wrench->force *= part;
        wrench->torque *= part;
    }
    contact_.stored *= part;
    contact_.surface_power *= part;
    contact_.depth *= part;
    contact_.displacement *= part;
    contact_.wrench.torque -=
        frame_->rotational_damping * part * static_cast<double>(contact_.in_contact) * grip_.velocity.angular;
    return contact_;
}

/// HAPTIC_FRAME_SERIES_SPRINGS: all planes of all particles share the grip's spring (series_springs.hpp).
Contact Tool::render_in_series(ToolMemory& memory) HAPTIC_RT {
    std::array<Particle, kMaxProxies> particles;           // NOLINT(*-member-init): filled below
    std::array<std::size_t, kMaxProxies + 1> first_row{};  // of each particle; the last entry: end of the rows
    std::span<SpringRow> rows = memory.rows;
    // One spring row per plane of each particle, in contact or not; one per touching particle with held positions.
    Planes planes{};
    std::size_t row_count = 0;
    for (std::size_t i = 0; i < count_; ++i) {
        const Particle& particle = particles[i] = locate(i, memory.friction[i], planes);
        first_row[i] = row_count;
        // Held positions: the correction itself is the one row.
        const double depth = glm::length(particle.correction);
        if (holds_positions() && depth > 0.0) {
            rows[row_count++] = {particle.moment_arm, particle.correction / depth, depth};
        }
        // Row of a plane: depth s = offset - n . g_i, negative in front of the plane.
        const Vec3 goal = grip_.pose.position + particle.moment_arm;
        for (const HalfSpace& plane : std::span(planes).first(particle.plane_count)) {
            rows[row_count++] = {particle.moment_arm, plane.normal, plane.offset - glm::dot(plane.normal, goal)};
        }
    }
    first_row[count_] = row_count;
    rows = rows.first(row_count);
    // Solve all springs at once: the push of each row, and the total wrench.
    const Wrench series_wrench =
        memory.springs.solve(rows, {stiffness_.force, stiffness_.torque, gyration(squares_, count_)});
    // Sum of the pushes, for the particles' shares of the frame's damping.
    double pushes = 0.0;  // N
    for (const SpringRow& row : rows) {
        pushes += row.push;
    }
    // Collect each particle's force from the pushes of its rows.
    Vec3 moments(0.0);
    double squared_displacements = 0.0;
    for (std::size_t i = 0; i < count_; ++i) {
        const Particle& particle = particles[i];
        // f_i = sum push n over the rows of particle i, and the power of its surfaces.
        Vec3 force(0.0);
        double power = 0.0;       // W, of its surfaces
        double own_pushes = 0.0;  // N, sum
        unsigned pushing = 0;
        for (std::size_t r = first_row[i]; r < first_row[i + 1]; ++r) {
            const SpringRow& row = rows[r];
            const auto plane = static_cast<unsigned>(r - first_row[i]);
            if (row.push > 0.0) {
                force += row.push * row.normal;
                own_pushes += row.push;
                power += holds_positions() ? 0.0 : row.push * particle.sent->planes[plane].velocity;
                pushing |= 1u << plane;
            }
        }
        // No row pushes: the particle is free.
        const double normal_force = glm::length(force);
        if (!(normal_force > 0.0)) {
            add_free_displacement(particle);
            continue;
        }
        // A particle in contact: depth |f_i| / k, its share of the damping, and friction scaled by |f_i| / (k |d|).
        ++contact_.in_contact;
        const double depth = glm::length(particle.correction);
        const double spring_depth = normal_force / stiffness_.force;
        const Load load{force / normal_force, spring_depth, power / normal_force, frame_->damping * own_pushes / pushes,
                        depth > 0.0 ? stiffness_.force * spring_depth / depth : 0.0};
        add_force(particle, load, 1.0);
        moments += glm::cross(particle.moment_arm, stiffness_.force * load.depth * load.normal);
        // Displacement relative to the planes that push it, and to the surface that it sticks to.
        double displacement = relative_displacement(particle.displacement, *particle.sent,
                                                    holds_positions() ? 0u : pushing, grip_.elapsed_s);
        if (particle.has_friction) {
            displacement = std::max(displacement, glm::length(particle.displacement - particle.surface_displacement));
        }
        squared_displacements += displacement * displacement;
    }
    // No contact: only the displacement of the free tool is averaged over N.
    contact_.max_moment_arm = std::sqrt(max_square_);
    if (contact_.in_contact == 0) {
        contact_.displacement = free_displacement_ / static_cast<double>(count_);
        return contact_;
    }
    // The springs' own torque replaces the sum of moments: it includes the rotation between grip and tool.
    contact_.surface_velocity /= contact_.depth;
    contact_.stored += memory.springs.stored_energy();
    contact_.displacement = kSeriesGain * std::sqrt(squared_displacements);
    contact_.wrench.torque += series_wrench.torque - moments;
    contact_.spring.torque += series_wrench.torque - moments;
    // Rotational damping grows like the series stiffness, M / (1 + M) for M particles in contact.
    const auto touching = static_cast<double>(contact_.in_contact);
    contact_.wrench.torque -= frame_->rotational_damping * touching / (1.0 + touching) * grip_.velocity.angular;
    return contact_;
}

}  // namespace

double squared_moment_arm(const ContactFrame& frame) HAPTIC_RT {
    // Sum of |o_i|^2 over the particles.
    double squares = 0.0;
    const std::size_t count = std::min<std::size_t>(frame.proxy_count, kMaxProxies);
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3 offset = to_vec3(frame.proxies[i].rest_offset);
        squares += glm::dot(offset, offset);
    }
    // In series rho^2, otherwise the mean.
    if ((frame.flags & HAPTIC_FRAME_SERIES_SPRINGS) != 0) {
        const double rho = gyration(squares, count);
        return rho * rho;
    }
    return count > 0 ? squares / static_cast<double>(count) : 0.0;
}

Contact render(const ContactFrame& frame, const Stiffness& stiffness, const GripMotion& grip, std::int64_t time_ns,
               ToolMemory& memory) HAPTIC_RT {
    if (frame.proxy_count == 0 || (frame.flags & HAPTIC_FRAME_CLUTCHED) != 0) {
        // No tool, or it is clutched: no wrench, and the next contact starts without friction state.
        memory.friction.fill({});
        Contact none;
        none.proxy = grip.pose.position;
        return none;
    }
    Tool tool(frame, stiffness, grip, time_ns);
    return tool.series() ? tool.render_in_series(memory) : tool.render_mean(memory);
}

Contact render(const ContactFrame& frame, const Pose& grip, const Twist& velocity, std::int64_t time_ns) HAPTIC_RT {
    ToolMemory none;
    return render(frame, stiffness_of(frame), {.pose = grip, .velocity = velocity, .previous = grip}, time_ns, none);
}

}  // namespace haptic::rt
