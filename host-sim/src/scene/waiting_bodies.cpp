#include "scene/waiting_bodies.hpp"

#include <algorithm>
#include <glm/geometric.hpp>

#include "collision/body_sweep.hpp"
#include "collision/surface_paths.hpp"
#include "dynamics/rotation.hpp"
#include "scene/assembly.hpp"
#include "scene/spread.hpp"

namespace haptic::sim {
namespace {

// A share is multiplied by this when its body has to wait; its least value; its growth in a step without waiting.
constexpr double kShrinks = 0.25;
constexpr double kLeastShare = 1.0 / 64.0;
constexpr double kGrows = 1.25;
// Of a lag: more than rounding adds to it while all moves alike.
constexpr double kRounding = 1e-9;

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

/// Moves bodies by the mean of their ways, or that of what is pinned of them, and a share of what goes beyond it. They
/// get the velocities of one rigid body with their momenta, and the same share of the rest; pins take momenta. Returns
/// the mean, m.
template <class IsOne>
Vec3 move_alike(const IsOne& is_one, double share, const ParticlePlaces& before, const WaitingBodies::Limits& limits,
                Assembly& assembly) noexcept {
    ParticleModel& model = assembly.model;
    // The mean.
    MassSums all;
    MassSums pinned;
    Vec3 centre(0.0);
    for_each_particle(assembly, is_one, [&](std::size_t i) {
        const Vec3 moved = model.position[i] - before.position[i];
        all.add(model.mass[i], moved, model.velocity[i]);
        centre += model.mass[i] * model.position[i];
        if (model.pinned[i] != 0) {
            pinned.add(model.mass[i], moved, model.velocity[i]);
        }
    });
    centre /= all.mass;
    const bool is_held = pinned.mass > 0.0;
    const MassSums& led = is_held ? pinned : all;
    Vec3 way = led.way / led.mass;
    way.y = std::max(way.y, limits.lowest_way);
    const Vec3 velocity = led.momentum / led.mass;
    Vec3 angular(0.0);
    for_each_particle(assembly, is_one, [&](std::size_t i) {
        angular += model.mass[i] * glm::cross(model.position[i] - centre, model.velocity[i] - velocity);
    });
    // Places.
    centre = Vec3(0.0);
    for_each_particle(assembly, is_one, [&](std::size_t i) {
        if (model.pinned[i] == 0) {
            const Vec3 alike = before.position[i] + way;
            model.position[i] = alike + share * (model.position[i] - alike);
            model.orientation[i] = between(before.orientation[i], model.orientation[i], share);
        }
        centre += model.mass[i] / all.mass * model.position[i];
    });
    // Velocities, and the rotation that is missing then.
    Mat3 scatter(0.0);
    for_each_particle(assembly, is_one, [&](std::size_t i) {
        const Vec3 arm = model.position[i] - centre;
        add_outer(scatter, model.mass[i], arm, arm);
        if (model.pinned[i] == 0) {
            model.velocity[i] = velocity + share * (model.velocity[i] - velocity);
        }
        angular -= model.mass[i] * glm::cross(arm, model.velocity[i] - velocity);
    });
    Vec3 turning = is_held ? Vec3(0.0) : solve_inertia(scatter, angular);
    if (const double speed = glm::length(turning); speed > limits.most_turning) {
        turning *= limits.most_turning / speed;
    }
    for_each_particle(assembly, is_one, [&](std::size_t i) {
        if (model.pinned[i] == 0) {
            model.velocity[i] += glm::cross(turning, model.position[i] - centre);
            model.angular_velocity[i] = turning + share * model.angular_velocity[i];
        }
    });
    return way;
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
}

void WaitingBodies::slow(std::size_t body, const ParticlePlaces& before, Assembly& assembly) const noexcept {
    const auto is_one = [&](std::size_t b) { return b == body; };
    (void)move_alike(is_one, share_[body], before, {}, assembly);
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

Vec3 WaitingBodies::let_wait(std::uint32_t group, const ParticlePlaces& before, const Limits& limits,
                             Assembly& assembly) const noexcept {
    return move_alike([&](std::size_t b) { return group_of_[b] == group; }, 0.0, before, limits, assembly);
}

}  // namespace haptic::sim
