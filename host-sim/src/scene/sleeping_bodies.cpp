#include "scene/sleeping_bodies.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numeric>
#include <utility>

#include "dynamics/model_bodies.hpp"
#include "dynamics/united.hpp"
#include "scene/assembly.hpp"

namespace haptic::sim {
namespace {

// How far a particle may go without having moved, of the mean radius of particles.
constexpr double kInPlace = 0.05;
// Ways of the last step, or of the next one, for which boxes are widened.
constexpr double kWays = 2.0;
// Places that a falling body must leave in the time after which it would sleep.
constexpr double kFalls = 4.0;
// Pairs for which there is room, per body; more allocate.
constexpr std::size_t kNeighbours = 64;

/// m/s, of the particles.
double fastest(const ParticleModel& model, const ParticleRange& particles) {
    double square = 0.0;
    for (std::uint32_t i = particles.begin; i < particles.end; ++i) {
        square = std::max(square, glm::dot(model.velocity[i], model.velocity[i]));
    }
    return std::sqrt(square);
}

/// Whether a body that nothing holds leaves its place in the time after which it would sleep.
bool falls(const SolverSettings& settings, double in_place) {
    // With drag it falls at least so far: y^2 / 2 / (1 + y) < y - 1 + exp(-y), where y = drag t.
    const double time = settings.sleep_after;
    const double way = 0.5 * glm::length(settings.gravity) * time * time / (1.0 + settings.drag * time);
    return way > kFalls * in_place;
}

/// Whether something holds a body that stays in its place, and nothing but contacts acts on it from outside.
bool may_sleep(const Assembly& assembly, std::size_t body, const SolverSettings& settings,
               std::span<const ParticleRange> elastic, double in_place) {
    const ParticleRange particles = assembly.particles_of(body);
    const bool is_held = !has_no_pinned(assembly.model, particles) || falls(settings, in_place);
    return is_held && assembly.is_movable(body) && assembly.motions[body].empty() && assembly.loads[body].empty() &&
           has_body_at(elastic, particles.begin);
}

}  // namespace

SleepingBodies::SleepingBodies(const Assembly& assembly, const SolverSettings& settings,
                               std::span<const std::uint8_t> collides)
    : place_(assembly.model.position),
      sweep_(0),
      asleep_(assembly.bodies.size(), 0),
      quiet_for_(assembly.bodies.size(), 0.0) {
    const std::vector<ParticleRange> elastic = elastic_bodies_of(assembly.model);
    for (std::uint32_t b = 0; b < assembly.bodies.size(); ++b) {
        if (!assembly.is_movable(b) && assembly.motions[b].empty()) {
            continue;
        }
        if (collides[b] != 0) {
            sheets_.push_back(static_cast<std::uint32_t>(bodies_.size()));
        }
        Body& body = bodies_.emplace_back();
        body.index = b;
        const ParticleRange range = assembly.particles_of(b);
        for (std::uint32_t i = range.begin; i < range.end; ++i) {
            const Vec3& axes = assembly.model.semi_axes[i];
            body.reach = std::max({body.reach, axes.x, axes.y, axes.z});
            body.in_place += kInPlace * assembly.model.radius[i] / (range.end - range.begin);
        }
        body.may_sleep = may_sleep(assembly, b, settings, elastic, body.in_place);
    }
    sweep_ = BodySweep(bodies_.size());
    near_.reserve(kNeighbours * bodies_.size());
    bounds_.resize(bodies_.size());
    parent_.resize(bodies_.size());
    is_awake_.resize(bodies_.size());
}

void SleepingBodies::update(Assembly& assembly, const Aabb& tool, std::span<const double> lag,
                            const SolverSettings& settings) {
    if (!(settings.sleep_after > 0.0)) {
        return;
    }
    find_quiet(assembly, lag, settings);
    unite_neighbours(assembly, settings);
    // A group sleeps if all of it is quiet; what the tool is near is not.
    std::ranges::fill(is_awake_, std::uint8_t{0});
    const Bounds near_tool = bounds_of(tool);
    for (std::uint32_t b = 0; b < bodies_.size(); ++b) {
        if (overlap(bounds_[b], near_tool)) {
            disturb(bodies_[b].index);
        }
        if (quiet_for_[bodies_[b].index] < settings.sleep_after) {
            is_awake_[root_of(parent_, b)] = 1;
        }
    }
    for (std::uint32_t b = 0; b < bodies_.size(); ++b) {
        const std::uint32_t body = bodies_[b].index;
        const std::uint8_t sleeps = is_awake_[root_of(parent_, b)] == 0 ? 1 : 0;
        if (std::exchange(asleep_[body], sleeps) != sleeps) {
            const ParticleRange range = assembly.particles_of(body);
            std::fill(assembly.model.asleep.begin() + range.begin, assembly.model.asleep.begin() + range.end, sleeps);
            if (sleeps != 0) {
                fall_asleep(assembly, body);
            } else {
                disturb(body);
            }
        }
    }
}

/// For how long bodies that are awake have stayed in their places.
void SleepingBodies::find_quiet(const Assembly& assembly, std::span<const double> lag, const SolverSettings& settings) {
    for (Body& body : bodies_) {
        if (!body.may_sleep || asleep_[body.index] != 0) {
            continue;
        }
        const ParticleRange range = assembly.particles_of(body.index);
        const auto now = std::span(assembly.model.position).subspan(range.begin, range.end - range.begin);
        const auto place = std::span(place_).subspan(range.begin, range.end - range.begin);
        const auto is_near = [&](const Vec3& a, const Vec3& b) {
            return glm::dot(a - b, a - b) <= body.in_place * body.in_place;
        };
        if (std::abs(lag[body.index] - body.lag) <= body.in_place && std::ranges::equal(now, place, is_near)) {
            quiet_for_[body.index] += settings.step;
        } else {
            std::ranges::copy(now, place.begin());
            body.lag = lag[body.index];
            disturb(body.index);
        }
    }
}

/// Joins bodies that may touch in the next step into groups.
void SleepingBodies::unite_neighbours(const Assembly& assembly, const SolverSettings& settings) {
    const double fall = glm::length(settings.gravity) * settings.step * settings.step;
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
        const SweptTree& tree = assembly.trees[bodies_[b].index];
        const Aabb way = tree.displacement();
        const Vec3 farthest = glm::max(glm::abs(way.min), glm::abs(way.max));
        // What a script leads may be fast from one step to the next; what sleeps is not.
        const std::uint32_t body = bodies_[b].index;
        const double speed = asleep_[body] == 0 ? fastest(assembly.model, assembly.particles_of(body)) : 0.0;
        const double most = std::max({farthest.x, farthest.y, farthest.z, settings.step * speed});
        bounds_[b] = bounds_of(grown(tree.bounds(), bodies_[b].reach + kWays * most + fall));
    }
    std::iota(parent_.begin(), parent_.end(), 0U);
    sweep_.find(bounds_, near_);
    for (const BodyPair& pair : near_) {
        unite(pair.first, pair.second);
    }
    for (const std::uint32_t sheet : sheets_) {
        unite(sheets_.front(), sheet);
    }
}

void SleepingBodies::unite(std::uint32_t one, std::uint32_t other) noexcept {
    parent_[root_of(parent_, other)] = root_of(parent_, one);
}

/// What holds a body takes the momentum that it still has.
void SleepingBodies::fall_asleep(Assembly& assembly, std::uint32_t body) const {
    const ParticleRange range = assembly.particles_of(body);
    for (std::uint32_t i = range.begin; i < range.end; ++i) {
        assembly.model.velocity[i] = assembly.model.angular_velocity[i] = Vec3(0.0);
    }
}

}  // namespace haptic::sim
