#include "scene/waiting_bodies.hpp"

#include <algorithm>
#include <glm/geometric.hpp>

#include "collision/body_sweep.hpp"
#include "collision/surface_paths.hpp"
#include "dynamics/rotation.hpp"
#include "scene/assembly.hpp"
#include "scene/rigid_group.hpp"
#include "scene/spread.hpp"

namespace haptic::sim {
namespace {

// A share is multiplied by this when its body has to wait; its least value; its growth in a step without waiting.
constexpr double kShrinks = 0.25;
constexpr double kLeastShare = 1.0 / 64.0;
constexpr double kGrows = 1.25;
// Of a lag: more than rounding adds to it while all moves alike.
constexpr double kRounding = 1e-9;
// rad: how far a group turns in a step, and is about to turn in the next one.
constexpr double kMostTurn = 0.25;
// m: how far a group may sink into the floor before it is lifted.
constexpr double kSinks = 1e-7;
// s, in which the motion of a group on a floor with friction shrinks to 1/e.
constexpr double kRestsAfter = 0.02;

/// Mass, and sums by mass, of particles.
struct MassSums {
    double mass = 0.0;   // kg
    Vec3 way{0.0};       // kg m
    Vec3 momentum{0.0};  // kg m/s

    void add(double m, const Vec3& moved, const Vec3& velocity) noexcept {
        mass += m;
        way += m * moved;
        momentum += m * velocity;
    }
};

/// The orientation at this share of the way from one to another.
Quat between(const Quat& from, const Quat& to, double share) noexcept {
    return glm::normalize(from + share * ((glm::dot(from, to) < 0.0 ? -to : to) - from));
}

/// Calls visit(particle) for each particle of the bodies for which is_one(body) holds.
template <class IsOne, class Visit>
void for_each_particle(const Assembly& assembly, const IsOne& is_one, const Visit& visit) {
    for (std::size_t b = 0; b < assembly.bodies.size(); ++b) {
        if (!is_one(b)) {
            continue;
        }
        const Skinner::Part part = assembly.part(b);
        for (std::size_t i = part.first_particle; i < part.first_particle + part.particles; ++i) {
            visit(i);
        }
    }
}

/// Mass, centre and scatter of the particles of bodies.
template <class IsOne>
RigidGroup group_at(std::span<const Vec3> position, const Assembly& assembly, const IsOne& is_one) noexcept {
    const std::span<const double> mass = assembly.model.mass;
    RigidGroup group;
    for_each_particle(assembly, is_one, [&](std::size_t i) {
        group.mass += mass[i];
        group.centre += mass[i] * position[i];
    });
    group.centre /= group.mass;
    for_each_particle(assembly, is_one, [&](std::size_t i) {
        const Vec3 arm = position[i] - group.centre;
        add_outer(group.scatter, mass[i], arm, arm);
    });
    return group;
}

/// Limits a rotation, rad or rad/s. Whether it was more.
bool limit_turn(Twist& twist, double most) noexcept {
    const double turn = glm::length(twist.angular);
    if (turn > most) {
        twist.angular *= most / turn;
    }
    return turn > most;
}

/// A vertex of a surface that a motion leads farthest below the floor.
struct Deepest {
    std::uint32_t vertex = 0;
    double depth = 0.0;  // m; 0: there is none
};

/// Of the surfaces of bodies, from where their vertices are, m; of none if these are not given.
template <class IsOne>
Deepest deepest(const RigidMotion& motion, const Assembly& assembly, const IsOne& is_one,
                std::span<const Vec3> vertices) noexcept {
    Deepest deepest;
    for (std::size_t b = 0; b < assembly.bodies.size() && !vertices.empty(); ++b) {
        if (!is_one(b)) {
            continue;
        }
        const Skinner::Part part = assembly.part(b);
        for (std::size_t v = part.first_vertex; v < part.first_vertex + part.vertices; ++v) {
            // What is below it already sinks no deeper.
            const double lowest = std::min(vertices[v].y, assembly.floor[b]);
            if (const double depth = lowest - motion(vertices[v]).y; depth > deepest.depth) {
                deepest = {static_cast<std::uint32_t>(v), depth};
            }
        }
    }
    return deepest;
}

/// The motion of bodies in a step, as if they were one.
struct MeanMotion {
    RigidGroup at_start;
    bool is_held = false;  // by what is pinned, whose motion it is then
    Twist way{};           // of the step, m and rad
    Twist speed{};         // m/s; its rotation is known at the end
    Vec3 angular{0.0};     // kg m^2/s, of what goes beyond the speed, about the centre

    [[nodiscard]] RigidMotion motion() const noexcept { return RigidMotion(at_start.centre, way.angular, way.linear); }
};

template <class IsOne>
MeanMotion mean_motion(const IsOne& is_one, const ParticlePlaces& before, const Assembly& assembly) noexcept {
    const ParticleModel& model = assembly.model;
    MeanMotion mean{.at_start = group_at(before.position, assembly, is_one)};
    // The mean way and speed, of all or of what is pinned.
    MassSums all;
    MassSums pinned;
    for_each_particle(assembly, is_one, [&](std::size_t i) {
        const Vec3 moved = model.position[i] - before.position[i];
        all.add(model.mass[i], moved, model.velocity[i]);
        if (model.pinned[i] != 0) {
            pinned.add(model.mass[i], moved, model.velocity[i]);
        }
    });
    mean.is_held = pinned.mass > 0.0;
    const MassSums& led = mean.is_held ? pinned : all;
    mean.way.linear = led.way / led.mass;
    mean.speed.linear = led.momentum / led.mass;
    if (mean.is_held) {
        return mean;
    }
    // What is free turns too.
    const Vec3 start = mean.at_start.centre;
    const Vec3 end = start + mean.way.linear;
    Vec3 turned(0.0);  // kg m^2
    for_each_particle(assembly, is_one, [&](std::size_t i) {
        const Vec3 moved = model.position[i] - before.position[i] - mean.way.linear;
        turned += model.mass[i] * glm::cross(before.position[i] - start, moved);
        mean.angular += model.mass[i] * glm::cross(model.position[i] - end, model.velocity[i] - mean.speed.linear);
    });
    mean.way.angular = solve_inertia(mean.at_start.scatter, turned);
    (void)limit_turn(mean.way, kMostTurn);
    return mean;
}

/// Lets the floor hold bodies up. What is below it still is lifted; pinned particles stay where they are.
template <class IsOne>
FloorSupports hold_above_floor(MeanMotion& mean, const IsOne& is_one, const WaitingBodies::Surroundings& around,
                               const Assembly& assembly) noexcept {
    const auto deepest_now = [&] { return deepest(mean.motion(), assembly, is_one, around.vertices); };
    FloorSupports supports;
    for (Deepest at = deepest_now(); at.depth > kSinks && !mean.is_held; at = deepest_now()) {
        if (!supports.raise(at.vertex, around.vertices[at.vertex], mean.at_start.centre, at.depth, mean.way)) {
            break;
        }
        supports.hold_up(mean.at_start, around.friction, mean.way);
        if (limit_turn(mean.way, kMostTurn)) {
            break;
        }
    }
    mean.way.linear.y += deepest_now().depth;
    return supports;
}

/// Gives what is not pinned the velocities of one rigid body with their momenta, and a share of the rest.
template <class IsOne>
void share_velocities(MeanMotion& mean, FloorSupports& supports, const IsOne& is_one, double share,
                      const WaitingBodies::Surroundings& around, Assembly& assembly) noexcept {
    ParticleModel& model = assembly.model;
    // A share of the rest, and the rotation that is missing then.
    const RigidGroup at_end = group_at(model.position, assembly, is_one);
    Twist& speed = mean.speed;
    for_each_particle(assembly, is_one, [&](std::size_t i) {
        if (model.pinned[i] == 0) {
            model.velocity[i] = share * (model.velocity[i] - speed.linear);
            mean.angular -= model.mass[i] * glm::cross(model.position[i] - at_end.centre, model.velocity[i]);
        }
    });
    if (!mean.is_held) {
        speed.angular = solve_inertia(at_end.scatter, mean.angular);
        (void)limit_turn(speed, kMostTurn / around.step);
        supports.stop(mean.motion(), at_end.centre);
        supports.hold_up(at_end, around.friction, speed);
        (void)limit_turn(speed, kMostTurn / around.step);
        if (!supports.is_empty() && around.friction > 0.0) {
            // Particles that make no way push along the floor all the same, and would let the group creep.
            const double left = kRestsAfter / (kRestsAfter + around.step);
            speed.linear *= left;
            speed.angular *= left;
        }
    }
    for_each_particle(assembly, is_one, [&](std::size_t i) {
        if (model.pinned[i] == 0) {
            model.velocity[i] += speed.at(model.position[i] - at_end.centre);
            model.angular_velocity[i] = speed.angular + share * model.angular_velocity[i];
        }
    });
}

/// Moves bodies as one rigid body by the mean of their motion, or with what is pinned of them, and by a share of what
/// goes beyond it. Pins and the floor take momenta. Returns the common motion.
template <class IsOne>
RigidMotion move_alike(const IsOne& is_one, double share, const ParticlePlaces& before,
                       const WaitingBodies::Surroundings& around, Assembly& assembly) noexcept {
    ParticleModel& model = assembly.model;
    MeanMotion mean = mean_motion(is_one, before, assembly);
    FloorSupports supports = hold_above_floor(mean, is_one, around, assembly);
    const RigidMotion motion = mean.motion();
    for_each_particle(assembly, is_one, [&](std::size_t i) {
        if (model.pinned[i] == 0) {
            const Vec3 alike = motion(before.position[i]);
            model.position[i] = alike + share * (model.position[i] - alike);
            model.orientation[i] = between(motion(before.orientation[i]), model.orientation[i], share);
        }
    });
    share_velocities(mean, supports, is_one, share, around, assembly);
    return motion;
}

}  // namespace

void ParticlePlaces::take(const ParticleModel& model) noexcept {
    std::ranges::copy(model.position, position.begin());
    std::ranges::copy(model.orientation, orientation.begin());
}

WaitingBodies::WaitingBodies(const Assembly& assembly, double farthest)
    : farthest_(assembly.bodies.size(), 0.0),
      share_(assembly.bodies.size(), 1.0),
      lag_before_(assembly.bodies.size(), 0.0),
      group_of_(assembly.bodies.size(), kNone) {
    for (std::size_t b = 0; b < farthest_.size(); ++b) {
        const SceneBody& body = assembly.bodies[b];
        if (!body.mesh.triangles.empty()) {
            const SolidSurface surface{.triangles = body.mesh.triangles, .first_vertex = body.first_vertex};
            farthest_[b] = farthest * mean_edge_of(surface, assembly.mesh.vertices);
        }
    }
}

void WaitingBodies::begin_step(std::span<const double> lag) noexcept {
    std::ranges::copy(lag, lag_before_.begin());
    std::ranges::fill(group_of_, kNone);
}

void WaitingBodies::slow(std::size_t body, const ParticlePlaces& before, double step,
                         Assembly& assembly) const noexcept {
    const auto is_one = [&](std::size_t b) { return b == body; };
    (void)move_alike(is_one, share_[body], before, {.step = step}, assembly);
}

bool WaitingBodies::is_to_wait(std::size_t body, double lag) const noexcept {
    return lag > std::max(farthest_[body], (1.0 + kRounding) * lag_before_[body]);
}

bool WaitingBodies::find(std::span<const double> lag, std::span<const std::uint8_t> may_wait,
                         std::span<const Bounds> box) {
    std::ranges::fill(group_of_, kNone);
    const auto meets = [&](std::size_t a, std::size_t b) {
        return !box.empty() && group_of_[b] == kNone && may_wait[b] != 0 && overlap(box[a], box[b]);
    };
    bool some = false;
    for (std::uint32_t b = 0; b < group_of_.size(); ++b) {
        if (may_wait[b] != 0 && group_of_[b] == kNone && is_to_wait(b, lag[b])) {
            group_of_[b] = b;
            spread(
                group_of_.size(), [&](std::size_t other) { return group_of_[other] == b; }, meets,
                [&](std::size_t other) { group_of_[other] = b; });
            some = true;
        }
    }
    for (std::size_t b = 0; b < share_.size(); ++b) {
        share_[b] =
            group_of_[b] == kNone ? std::min(1.0, kGrows * share_[b]) : std::max(kLeastShare, kShrinks * share_[b]);
    }
    return some;
}

RigidMotion WaitingBodies::let_wait(std::uint32_t group, const ParticlePlaces& before, const Surroundings& around,
                                    Assembly& assembly) const noexcept {
    return move_alike([&](std::size_t b) { return group_of_[b] == group; }, 0.0, before, around, assembly);
}

}  // namespace haptic::sim
