// Contacts that move whole bodies: momenta of bodies that collide, energy, and bodies that roll.
#include "collision/body_contacts.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <numeric>
#include <utility>
#include <vector>

#include "clouds.hpp"
#include "haptic/denormals.hpp"
#include "haptic/sim/block.hpp"
#include "haptic/sim/collisions.hpp"
#include "haptic/sim/elasticity.hpp"
#include "haptic/sim/model_builder.hpp"
#include "haptic/sim/solver.hpp"

namespace haptic::sim {
namespace {

constexpr SolidMaterial kFirm{.young_modulus = 1e6, .density = 1000.0};
constexpr Vec3 kNowhere(0.0);

ParticleModel with_material(ParticleModel model) {
    model.elasticity = make_solid(model, std::vector<SolidMaterial>(model.size(), kFirm));
    model.groups.clear();
    return model;
}

/// A block of 0.12 x 0.06 x 0.08 m.
ParticleModel block() {
    const Vec3 size(0.12, 0.06, 0.08);
    BuilderSettings settings;
    settings.particles = 60;
    settings.neighbours = 16;
    settings.mass = kFirm.density * size.x * size.y * size.z;
    return with_material(build_body(make_block_mesh({.size = size, .cells = 12}), settings).particles);
}

/// A ball that touches as a sphere: particles in a grid, where the one in the middle alone collides.
ParticleModel ball(double radius) {
    const double spacing = 0.5 * radius;
    ParticleModel model;
    for (int k = 0; k < 27; ++k) {
        const Vec3 at(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
        model.add(spacing * at, kFirm.density * spacing * spacing * spacing, 0.5 * spacing);
        model.semi_axes.back() = Vec3(k == 13 ? radius : 0.0);
    }
    for (std::uint32_t i = 0; i < model.size(); ++i) {
        Group group{.centre = i, .members = std::vector<std::uint32_t>(model.size())};
        std::iota(group.members.begin(), group.members.end(), 0U);
        std::ranges::sort(group.members, {}, [&](std::uint32_t j) {
            return std::pair(glm::distance(model.position[i], model.position[j]), j);
        });
        group.members.resize(16);
        model.groups.push_back(group);
    }
    return with_material(model);
}

ParticleModel moving(const ParticleModel& body, const Vec3& to, const Vec3& velocity, const Vec3& spin) {
    ParticleModel model = moved(body, to, velocity);
    for (std::size_t i = 0; i < model.size(); ++i) {
        model.velocity[i] += glm::cross(spin, model.position[i] - to);
        model.angular_velocity[i] = spin;
    }
    return model;
}

ParticleModel two(ParticleModel one, const ParticleModel& other) {
    one.append(other);
    return one;
}

double mass_of(const ParticleModel& model) {
    return std::accumulate(model.mass.begin(), model.mass.end(), 0.0);
}

/// kg m^2, about the axis z through the origin at the start.
double inertia_about_z(const ParticleModel& model) {
    double sum = 0.0;
    for (std::size_t i = 0; i < model.size(); ++i) {
        const Vec3& x = model.rest_position[i];
        sum += model.mass[i] * (x.x * x.x + x.y * x.y);
    }
    return sum;
}

TEST(BodyContacts, KeepLinearAndAngularMomentumAndGiveNoEnergy) {
    const FlushDenormals flush;
    const auto starts = {two(moving(block(), {0.0, 0.09, 0.02}, {0.4, -1.5, 0.0}, {8.0, 0.0, -6.0}),
                             moving(block(), kNowhere, {0.0, 0.5, 0.3}, {0.0, 5.0, 9.0})),
                         two(moving(ball(0.05), {0.03, 0.11, 0.0}, {0.0, -2.0, 0.0}, {0.0, 0.0, 20.0}),
                             moving(ball(0.04), kNowhere, {0.1, 1.0, 0.0}, {30.0, 0.0, 0.0})),
                         two(moving(block(), {0.0, 0.12, 0.0}, {0.0, -1.0, 0.2}, {4.0, 2.0, 0.0}),
                             moving(ball(0.05), kNowhere, {0.0, 1.0, 0.0}, {0.0, 20.0, 20.0}))};
    for (const ParticleModel& slow : starts) {
        for (const double faster : {1.0, 8.0}) {
            ParticleModel start = slow;
            for (std::size_t i = 0; i < start.size(); ++i) {
                start.velocity[i] *= faster;
                start.angular_velocity[i] *= faster;
            }
            const double energy = kinetic_energy(start);
            const double momentum = std::sqrt(2.0 * mass_of(start) * energy);  // kg m/s, of the order of the parts'
            const double moment = 0.1 * momentum;                              // kg m^2/s, at their distances
            for (const double step : {0.001, 0.004, 0.01}) {
                ParticleModel model = start;
                ParticleCollisions collisions(
                    model, {.static_friction = 0.6, .dynamic_friction = 0.5, .push_out_speed = 0.0}, nullptr);
                ParticleSolver solver(model, {.step = step, .substeps = 0, .gravity = kNowhere});
                double most = 0.0;
                for (double time = 0.0; time < 0.3 / faster; time += step) {
                    solver.step(model, {}, {&collisions});
                    most = std::max(most, kinetic_energy(model));
                }
                EXPECT_LT(most, (1.0 + 1e-9) * energy) << step;
                EXPECT_LT(kinetic_energy(model), 0.99 * energy) << step;
                EXPECT_LT(glm::length(linear_momentum(model) - linear_momentum(start)), 1e-10 * momentum) << step;
                EXPECT_LT(glm::length(angular_momentum(model) - angular_momentum(start)), 1e-10 * moment) << step;
            }
        }
    }
}

/// What a ball rolls on: the ground, or a pinned block, before or after it in the model.
enum class Slope : std::uint8_t { Ground, BlockBefore, BlockAfter };

/// The ball on a slope at the origin.
ParticleModel on_slope(Slope slope, double radius) {
    ParticleModel model = moving(ball(radius), {0.0, radius, 0.0}, kNowhere, kNowhere);
    if (slope == Slope::Ground) {
        return model;
    }
    // One particle, so wide that it is flat.
    ParticleModel flat;
    flat.add({0.0, -200.0, 0.0}, 1.0, 1.0);
    flat.semi_axes[0] = {2000.0, 200.0, 2000.0};
    flat.pinned[0] = 1;
    return slope == Slope::BlockBefore ? two(flat, model) : two(model, flat);
}

TEST(BodyContacts, LetABallRollDownASlopeAndSlideOnOneThatIsTooSteep) {
    const FlushDenormals flush;
    const double radius = 0.05;
    const double sticking = 0.4;
    const double sliding = 0.3;
    const double duration = 0.4;
    for (const Slope on : {Slope::Ground, Slope::BlockBefore, Slope::BlockAfter}) {
        for (const double slope : {0.2, 0.4, 1.2}) {
            for (const double step : {0.002, 0.01}) {
                const Vec3 gravity = 9.81 * Vec3(std::sin(slope), -std::cos(slope), 0.0);
                ParticleModel model = on_slope(on, radius);
                const ParticleModel alone = ball(radius);
                // Rolling: m a = m g sin - F, I a / R = F R, as long as friction can hold F.
                const double mass = mass_of(alone);
                const double inertia = inertia_about_z(alone);
                const double rolling = gravity.x / (1.0 + inertia / (mass * radius * radius));
                const bool rolls = gravity.x - rolling < sticking * -gravity.y;
                const double expected = rolls ? rolling : gravity.x + sliding * gravity.y;
                const double spin = rolls ? expected / radius : sliding * -gravity.y * mass * radius / inertia;
                ParticleCollisions collisions(
                    model, {.ground = on == Slope::Ground, .static_friction = sticking, .dynamic_friction = sliding},
                    nullptr);
                ParticleSolver solver(model, {.step = step, .substeps = 0, .gravity = gravity});
                for (double time = 0.0; time < duration - 0.5 * step; time += step) {
                    solver.step(model, {}, {&collisions});
                }
                const std::size_t first = on == Slope::BlockBefore ? 1 : 0;
                const Vec3 centre = model.position[first + 13];
                double speed = 0.0;
                double turning = 0.0;
                for (std::size_t i = first; i < first + alone.size(); ++i) {
                    speed += model.mass[i] / mass * model.velocity[i].x;
                    turning -= model.mass[i] * glm::cross(model.position[i] - centre, model.velocity[i]).z / inertia;
                }
                EXPECT_NEAR(speed, expected * duration, 0.02 * expected * duration)
                    << slope << " rad, " << step << " s";
                EXPECT_NEAR(turning, spin * duration, 0.02 * spin * duration) << slope << " rad, " << step << " s";
            }
        }
    }
}

TEST(BodyContacts, HoldWhatHasNoExtent) {
    const FlushDenormals flush;
    ParticleModel model = moving(ball(0.05), {0.0, 0.06, 0.0}, kNowhere, {0.0, 0.0, 3.0});
    model.semi_axes.assign(model.size(), kNowhere);
    model.semi_axes[0] = {0.01, 0.0, 0.01};  // flat, and level at first
    ParticleCollisions collisions(model, {.ground = true, .static_friction = 0.4, .dynamic_friction = 0.3}, nullptr);
    ParticleSolver solver(model, {.step = 0.005, .substeps = 0});
    for (int k = 0; k < 200; ++k) {
        solver.step(model, {}, {&collisions});
    }
    for (const Vec3& p : model.position) {
        EXPECT_GT(p.y, -0.01);  // and is a number
        EXPECT_LT(glm::length(p), 0.5);
    }
}

}  // namespace
}  // namespace haptic::sim
