#include "haptic/sim/solver.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <memory>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "dynamics/rotation.hpp"
#include "free_motion.hpp"
#include "haptic/denormals.hpp"
#include "haptic/sim/cloth.hpp"
#include "scene/state_hash.hpp"
#include "simd/projection.hpp"

namespace haptic::sim {
namespace {

ParticleModel sheet(std::uint32_t side = 9) {
    return make_cloth_particles({.vertices_per_side = side, .side = 0.25, .mass = 0.01}, 0.7, 1.0);
}

/// Random displacements and velocities, so that every constraint is violated.
ParticleModel crumpled_sheet(std::uint32_t side = 9) {
    ParticleModel model = sheet(side);
    std::mt19937 random(3);
    std::normal_distribution<double> normal;
    const auto vector = [&] { return Vec3{normal(random), normal(random), normal(random)}; };
    for (std::size_t i = 0; i < model.size(); ++i) {
        model.position[i] += 0.01 * vector();
        model.velocity[i] += 0.3 * vector() + Vec3(1.0, -2.0, 0.5);
        model.orientation[i] = turned(model.orientation[i], 0.3 * vector());
        model.angular_velocity[i] = vector();
    }
    return model;
}

/// Groups and links of all sizes between random particles, some pinned, some coincident: everything that makes lanes
/// differ.
ParticleModel tangle(std::uint32_t seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    const auto vector = [&] { return Vec3{normal(random), normal(random), normal(random)}; };
    const auto below = [&](std::uint32_t n) { return std::uniform_int_distribution<std::uint32_t>(0, n - 1)(random); };
    ParticleModel model;
    const std::uint32_t count = 150;
    for (std::uint32_t i = 0; i < count; ++i) {
        model.add(vector(), std::exp(normal(random)), i % 5 == 0 ? 0.0 : 0.1);
        model.position[i] += 0.1 * vector();
        model.velocity[i] = vector();
        model.orientation[i] = turned(model.orientation[i], vector());
        model.angular_velocity[i] = vector();
        model.pinned[i] = below(12) == 0 ? 1 : 0;
        if (model.pinned[i] != 0) {
            model.position[i].x = -0.0;  // adding even 0 would change it
        }
    }
    for (std::uint32_t c = 0; c < 40; ++c) {
        Group group{c, {c}, 0.1 * below(11)};
        group.compliance = c % 3 == 0 ? 1e-5 * c : 0.0;
        for (std::uint32_t more = below(8); more > 0; --more) {
            group.members.push_back((group.members.back() + 1 + below(10)) % count);
        }
        model.groups.push_back(group);
    }
    model.groups.push_back({count - 1, {count - 1}, 1.0});
    for (int l = 0; l < 60; ++l) {
        const std::uint32_t first = below(count);
        model.links.push_back({first, (first + 1 + below(count - 1)) % count, std::abs(normal(random)), 0.9});
        model.links.back().compliance = l % 4 == 0 ? 1e-4 * l : 0.0;
    }
    const Link& closed = model.links[7];
    model.position[closed.second] = model.position[closed.first];
    model.velocity[closed.second] = model.velocity[closed.first];
    return model;
}

std::uint64_t hash_of(const ParticleModel& model) {
    StateHash hash;
    hash.add(std::span<const Vec3>(model.position));
    hash.add(std::span<const Vec3>(model.velocity));
    hash.add(std::span<const Quat>(model.orientation));
    hash.add(std::span<const Vec3>(model.angular_velocity));
    return hash.value();
}

constexpr double kRounding = 0x1p-24;                     // of float projections, relative to the size of a group
constexpr double kSheetRounding = 8 * 0.044 * kRounding;  // m, over the 8 cells of a sheet(), 4.4 cm across

TEST(Solver, KeepsLinearAndAngularMomentumOfAFreeSheet) {
    ParticleModel model = crumpled_sheet();
    ParticleSolver solver(model, kFree);
    const Vec3 linear = linear_momentum(model);
    const Vec3 angular = angular_momentum(model);
    for (int i = 0; i < 500; ++i) {
        solver.step(model, {});
    }
    // Rounding only: 500 steps of sums over 81 particles with positions up to 5 m from the origin.
    EXPECT_LT(glm::length(linear_momentum(model) - linear), 1e-12 * glm::length(linear) * 500);
    EXPECT_LT(glm::length(angular_momentum(model) - angular), 1e-11 * glm::length(linear));
}

TEST(Solver, OneProjectionKeepsAngularMomentumOfEachGroup) {
    // From rest, with one pass and without the momentum correction, the momentum after a step comes from the
    // projections alone and is of second order in the motion: halving the displacement must quarter it.
    const auto made = [](double scale) {
        ParticleModel model = sheet();
        const ParticleModel shaken = crumpled_sheet();
        for (std::size_t i = 0; i < model.size(); ++i) {
            model.position[i] += scale * (shaken.position[i] - model.position[i]);
        }
        SolverSettings settings = kFree;
        settings.iterations = 1;
        settings.keep_angular_momentum = false;
        // All groups on the same state, so that no group sees the motion by another.
        ParticleModel one_group = model;
        one_group.links.clear();
        one_group.groups.resize(1);
        ParticleSolver(one_group, settings).step(one_group, {});
        return glm::length(angular_momentum(one_group)) / std::sqrt(kinetic_energy(one_group));
    };
    // One group, projected at the state where momentum is defined: only rounding may remain, relative to the momentum
    // of a rigid body with its inertia (4 corners of a cell of 3 cm), sqrt(2 I) per root of energy.
    const double inertia = 4.0 * (0.01 / 81.0) * 0.022 * 0.022;  // kg m^2
    EXPECT_LT(made(1.0), 64.0 * kRounding * std::sqrt(2.0 * inertia));
    EXPECT_LT(made(0.5), 64.0 * kRounding * std::sqrt(2.0 * inertia));
}

TEST(Solver, FallsAsTheSemiImplicitSchemePredicts) {
    ParticleModel model = sheet();
    const SolverSettings settings;
    ParticleSolver solver(model, settings);
    const int steps = 100;
    for (int i = 0; i < steps; ++i) {
        solver.step(model, {});
    }
    // x_n = g h^2 (1 + 2 + ... + n) = g h^2 n (n + 1) / 2
    const double fall = 9.81 * settings.step * settings.step * steps * (steps + 1) / 2.0;
    for (std::size_t i = 0; i < model.size(); ++i) {
        EXPECT_LT(glm::length(model.position[i] - (model.rest_position[i] - Vec3(0.0, fall, 0.0))), kSheetRounding);
        EXPECT_NEAR(model.velocity[i].y, -9.81 * settings.step * steps, 1e-10);
    }
}

TEST(Solver, LeavesTheRestShapeAtRest) {
    ParticleModel model = sheet();
    ParticleSolver solver(model, kFree);
    for (int i = 0; i < 100; ++i) {
        solver.step(model, {});
    }
    for (std::size_t i = 0; i < model.size(); ++i) {
        EXPECT_LT(glm::length(model.position[i] - model.rest_position[i]), kSheetRounding);
        EXPECT_NEAR(std::abs(model.orientation[i].w), 1.0, 1e-12);
    }
}

TEST(Solver, KeepsARotatedModelRigid) {
    ParticleModel model = sheet();
    const Quat turn = glm::angleAxis(2.0, glm::normalize(Vec3(1.0, -0.5, 2.0)));
    for (std::size_t i = 0; i < model.size(); ++i) {
        model.position[i] = turn * model.rest_position[i] + Vec3(1.0, 2.0, 3.0);
        model.orientation[i] = turn;
    }
    ParticleSolver solver(model, kFree);
    for (int i = 0; i < 100; ++i) {
        solver.step(model, {});
    }
    for (std::size_t i = 0; i < model.size(); ++i) {
        EXPECT_LT(glm::length(model.position[i] - (turn * model.rest_position[i] + Vec3(1.0, 2.0, 3.0))),
                  4.0 * kSheetRounding);  // cells rotate alike only up to rounding
    }
}

TEST(Solver, SpinsAtAConstantRateAndKeepsItsShape) {
    ParticleModel model = sheet();
    const Vec3 rate(0.0, 3.0, 0.0);  // rad/s, in the plane of the sheet
    for (std::size_t i = 0; i < model.size(); ++i) {
        model.velocity[i] = glm::cross(rate, model.position[i]);
        model.angular_velocity[i] = rate;
    }
    ParticleSolver solver(model, kFree);
    const double energy = kinetic_energy(model);
    for (int i = 0; i < 1000; ++i) {
        solver.step(model, {});
    }
    EXPECT_NEAR(kinetic_energy(model), energy, 0.01 * energy);
    // A stretch of 0.5e-3 is the centrifugal displacement h^2 w^2 / 2 of a step before projection.
    for (const Link& link : model.links) {
        const double length = glm::length(model.position[link.second] - model.position[link.first]);
        EXPECT_NEAR(length, link.rest_length, 1e-3 * link.rest_length);
    }
}

TEST(Solver, NeverGainsEnergy) {
    ParticleModel model = crumpled_sheet(5);
    ParticleSolver solver(model, kFree);
    double highest = 0.0;  // J; after the first steps have converted deformation to motion
    for (int i = 0; i < 20; ++i) {
        solver.step(model, {});
        highest = std::max(highest, inner_kinetic_energy(model));
    }
    for (int i = 0; i < 10'000; ++i) {
        solver.step(model, {});
        ASSERT_LE(inner_kinetic_energy(model), highest * (1.0 + 1e-9)) << "step " << i;
    }
    EXPECT_TRUE(is_finite(model));
}

TEST(Solver, LeavesPinnedParticlesWhereTheyAre) {
    ParticleModel model = sheet();
    model.pinned[0] = model.pinned[8] = 1;
    ParticleSolver solver(model, {});
    for (int i = 0; i < 300; ++i) {
        solver.step(model, {});
    }
    EXPECT_EQ(model.position[0], model.rest_position[0]);
    EXPECT_EQ(model.position[8], model.rest_position[8]);
    EXPECT_EQ(model.velocity[0], Vec3(0.0));
    // The rest hangs: the far edge has swung down and stopped.
    EXPECT_LT(model.position[76].y, -0.1);
    EXPECT_GT(model.position[76].y, -0.4);
}

TEST(Solver, MovesPinnedParticlesByTheirVelocitiesOnly) {
    for (const int substeps : {1, 4}) {
        ParticleModel model = sheet();
        model.pinned[0] = model.pinned[40] = 1;
        const Vec3 velocity(0.5, 1.0, -0.25);
        const Vec3 rate(0.0, 2.0, 0.0);
        model.velocity[0] = velocity;
        model.angular_velocity[0] = rate;
        const SolverSettings settings{.substeps = substeps, .drag = 3.0, .shape_damping = 2.0};
        const double h = settings.step / substeps;
        ParticleSolver solver(model, settings);
        Quat turn = model.orientation[0];
        const int steps = 50;
        for (int i = 0; i < steps; ++i) {
            solver.step(model, {});
            for (int s = 0; s < substeps; ++s) {
                turn = turned(turn, h * rate);
            }
        }
        EXPECT_EQ(model.velocity[0], velocity);
        EXPECT_EQ(model.angular_velocity[0], rate);
        const Vec3 there = model.rest_position[0] + settings.step * steps * velocity;
        EXPECT_LT(glm::length(model.position[0] - there), 1e-14 * steps * substeps);
        EXPECT_NEAR(std::abs(glm::dot(model.orientation[0], turn)), 1.0, 1e-14);
        EXPECT_EQ(model.position[40], model.rest_position[40]);
    }
}

TEST(Solver, PullsFreeParticlesAlongWithMovingPinnedOnes) {
    ParticleModel model = sheet();
    const Vec3 velocity(1.0, 0.0, 0.0);
    for (std::size_t i = 0; i < 9; ++i) {
        model.pinned[i] = 1;
        model.velocity[i] = velocity;
    }
    SolverSettings settings = kFree;
    settings.drag = 1.0;
    ParticleSolver solver(model, settings);
    for (int i = 0; i < 500; ++i) {
        solver.step(model, {});
    }
    for (std::size_t i = 0; i < model.size(); ++i) {
        EXPECT_LT(glm::length(model.velocity[i] - velocity), 0.02) << i;  // m/s
        EXPECT_NEAR(model.position[i].x, model.rest_position[i].x + 5.0, 0.03) << i;
    }
}

/// Records the solver's calls and moves one particle in each iteration.
class Prodding : public SolverContacts {
  public:
    Prodding(std::size_t particle, const Vec3& by) : particle_(particle), by_(by) {}
    void begin(const ParticleModel& /*start*/, ElasticBodies& /*elastic*/, const MovingParticles& /*now*/,
               double /*h*/) override {
        calls += 'b';
        pushed_ = Vec3(0.0);
    }
    void search(const ParticleModel& start, const PredictedMotion& predicted, double h) override {
        calls += 's';
        seen.push_back(start.position[particle_].x + h * predicted.velocity[3 * particle_]);
    }
    void project(const ParticleModel& /*start*/, const MovingParticles& now, double /*h*/) override {
        calls += 'p';
        for (int k = 0; k < 3; ++k) {
            now.position[particle_].number[k] += by_[k];
        }
        pushed_ += by_;
    }
    void finish(const ParticleModel& /*start*/, const MovingParticles& now, double /*h*/) override {
        calls += '.';
        for (int k = 0; k < 3; ++k) {
            now.pushed[particle_].number[k] += pushed_[k];
        }
    }
    std::vector<double> seen;  // x, at each sub-step
    std::string calls;

  private:
    std::size_t particle_;
    Vec3 by_;
    Vec3 pushed_{0.0};  // m, in this sub-step
};

TEST(Solver, FindsContactsInEachSubStepAndProjectsThemInEachIteration) {
    ParticleModel model = sheet();
    model.pinned[0] = 1;
    model.velocity[0] = {4.0, 0.0, 0.0};
    ParticleSolver solver(model, {.step = 0.01, .substeps = 4, .iterations = 3});
    Prodding nothing(0, Vec3(0.0));
    const double x = model.position[0].x;
    solver.step(model, {}, {&nothing});
    EXPECT_EQ(nothing.calls, "bsppp.bsppp.bsppp.bsppp.");
    ASSERT_EQ(nothing.seen.size(), 4u);
    for (int s = 0; s < 4; ++s) {
        EXPECT_NEAR(nothing.seen[static_cast<std::size_t>(s)], x + 0.01 * (s + 1), 1e-15);
    }
}

TEST(Solver, ContactsChangeTheMomentaByWhatTheyPush) {
    ParticleModel model = crumpled_sheet();
    ParticleSolver solver(model, kFree);
    for (int i = 0; i < 20; ++i) {
        const Vec3 push(2e-5, -1e-5, 3e-5);
        Prodding contact(8, push);
        // Once per iteration; the push acts at the particle's position at the start.
        const Vec3 impulse = model.mass[8] * (kFree.iterations / kFree.step) * push;
        const Vec3 linear = linear_momentum(model) + impulse;
        const Vec3 angular = angular_momentum(model) + glm::cross(model.position[8], impulse);
        solver.step(model, {}, {&contact});
        EXPECT_LT(glm::length(linear_momentum(model) - linear), 1e-14);
        // The new momentum is evaluated at the particles' new positions.
        EXPECT_LT(glm::length(angular_momentum(model) - angular), 1e-14);
    }
}

TEST(Solver, ABodyHasTheSameBitsAloneAndBesideOthers) {
    const ParticleModel first = crumpled_sheet(9);
    ParticleModel second = crumpled_sheet(6);
    second.pinned[3] = 1;
    second.velocity[3] = Vec3(0.1);
    ParticleModel both = first;
    both.append(second);
    const SolverSettings settings{.substeps = 2, .shape_damping = 1.0};
    const auto run = [&](ParticleModel model) {
        ParticleSolver solver(model, settings);
        for (int i = 0; i < 30; ++i) {
            solver.step(model, {});
        }
        return model;
    };
    const ParticleModel alone = run(first);
    const ParticleModel also_alone = run(second);
    const ParticleModel together = run(both);
    for (std::size_t i = 0; i < together.size(); ++i) {
        const ParticleModel& of = i < first.size() ? alone : also_alone;
        const std::size_t k = i < first.size() ? i : i - first.size();
        ASSERT_EQ(together.position[i], of.position[k]) << i;
        ASSERT_EQ(together.velocity[i], of.velocity[k]) << i;
        ASSERT_EQ(together.orientation[i], of.orientation[k]) << i;
    }
}

TEST(Solver, EachFreeBodyKeepsItsMomentaBesideAPinnedOne) {
    ParticleModel first = crumpled_sheet();
    ParticleModel second = crumpled_sheet();
    for (std::size_t i = 0; i < second.size(); ++i) {
        second.position[i] += Vec3(0.0, 3.0, 0.0);
        second.velocity[i] = -0.5 * second.velocity[i] + glm::cross(Vec3(3.0, 0.0, 2.0), second.position[i]);
    }
    ParticleModel held = sheet();
    held.pinned[0] = 1;
    ParticleModel model = first;
    model.append(second);
    model.append(held);
    const auto part = [&](std::size_t body) {
        ParticleModel only;
        for (std::size_t i = model.bodies[body].begin; i < model.bodies[body].end; ++i) {
            only.add(model.position[i], model.mass[i], 0.0);
            only.velocity.back() = model.velocity[i];
        }
        return only;
    };
    SolverSettings settings = kFree;
    settings.shape_damping = 3.0;
    ParticleSolver solver(model, settings);
    const std::vector<ParticleModel> before{part(0), part(1)};
    for (int i = 0; i < 300; ++i) {
        solver.step(model, {});
    }
    for (std::size_t b = 0; b < 2; ++b) {
        // Rounding only: in each of 300 steps of 0.01 s about 50 projections round positions up to 30 m away; 10 g.
        const double rounding = 300 * 50 * 0.01 * (30.0 * 0x1p-53) / 0.01;
        EXPECT_LT(glm::length(linear_momentum(part(b)) - linear_momentum(before[b])), rounding) << b;
        EXPECT_LT(glm::length(angular_momentum(part(b)) - angular_momentum(before[b])), 30.0 * rounding) << b;
    }
}

TEST(Solver, HasTheSameBitsOnEveryMachine) {
    // A cloth released with two corners fixed. The hash changes with every change of the arithmetic, but must be the
    // same for all compilers, optimisation levels and CPUs.
    const FlushDenormals flush;
    for (const std::size_t lanes : ParticleSolver::usable_lanes()) {
        ParticleModel model = sheet(17);
        model.pinned[0] = model.pinned[16] = 1;
        ParticleSolver solver(model, {.shape_damping = 1.0}, lanes);
        for (int i = 0; i < 100; ++i) {
            solver.step(model, {});
        }
        EXPECT_EQ(hash_of(model), 0x4231f053ad469281u) << lanes << " lanes";
    }
}

TEST(Solver, HasTheSameBitsWithAnyNumberOfLanes) {
    const auto widths = ParticleSolver::usable_lanes();
    ASSERT_GE(widths.size(), 2u);
    for (std::uint32_t seed = 0; seed < 20; ++seed) {
        const ParticleModel model = tangle(seed);
        const SolverSettings settings{.step = 0.004, .substeps = 2, .iterations = 3, .shape_damping = 2.0};
        const auto run = [&](std::size_t lanes, bool flushed) {
            ParticleModel copy = model;
            ParticleSolver solver(copy, settings, lanes);
            EXPECT_EQ(solver.lanes(), lanes);
            const auto flush = flushed ? std::make_unique<FlushDenormals>() : nullptr;
            for (int i = 0; i < 5; ++i) {
                solver.step(copy, {});
            }
            EXPECT_TRUE(is_finite(copy));
            return hash_of(copy);
        };
        for (const std::size_t lanes : widths) {
            EXPECT_EQ(run(lanes, true), run(1, true)) << lanes << " lanes, seed " << seed;
            EXPECT_EQ(run(lanes, false), run(1, false)) << lanes << " lanes, seed " << seed;
        }
    }
}

TEST(Solver, UsesTheWidestLanesByDefault) {
    const ParticleModel model = sheet();
    EXPECT_EQ(ParticleSolver(model, {}).lanes(), ParticleSolver::usable_lanes().back());
    EXPECT_EQ(ParticleSolver::usable_lanes().front(), 1u);
    EXPECT_THROW(ParticleSolver(model, {}, 3), std::invalid_argument);
}

TEST(Solver, ShapeDampingKeepsMomentum) {
    ParticleModel model = crumpled_sheet();
    SolverSettings settings = kFree;
    settings.shape_damping = 5.0;
    ParticleSolver solver(model, settings);
    const Vec3 linear = linear_momentum(model);
    const Vec3 angular = angular_momentum(model);
    for (int i = 0; i < 300; ++i) {
        solver.step(model, {});
    }
    EXPECT_LT(glm::length(linear_momentum(model) - linear), 1e-12);
    EXPECT_LT(glm::length(angular_momentum(model) - angular), 1e-11);
    for (const Link& link : model.links) {
        const Vec3 along = model.position[link.second] - model.position[link.first];
        const Vec3 apart = model.velocity[link.second] - model.velocity[link.first];
        EXPECT_NEAR(glm::dot(along, apart) / link.rest_length, 0.0, 1e-3);  // m/s
    }
}

TEST(Solver, PullsAStretchedPairToItsLength) {
    ParticleModel model;
    model.add({0.0, 0.0, 0.0}, 1.0, 0.0);
    model.add({1.0, 0.0, 0.0}, 3.0, 0.0);
    model.links.push_back({0, 1, 1.0, 1.0});
    model.position[1].x = 1.4;
    ParticleSolver solver(model, kFree);
    solver.step(model, {});
    EXPECT_NEAR(model.position[0].x, 0.3, 1.4 * kRounding);  // in inverse proportion to mass
    EXPECT_NEAR(model.position[1].x, 1.3, 1.4 * kRounding);
}

/// A chain that hangs from its first particle along -y, with drag, so that it comes to rest.
ParticleModel hanging_chain(std::uint32_t links, double mass, double compliance) {
    ParticleModel model;
    model.add(Vec3(0.0), 1.0, 0.0);
    model.pinned[0] = 1;
    for (std::uint32_t k = 1; k <= links; ++k) {
        model.add(Vec3(0.0, -0.1 * k, 0.0), mass, 0.0);
        model.links.push_back({k - 1, k, 0.1, 1.0, compliance});
    }
    return model;
}

TEST(Solver, ACompliantLinkStretchesAsTheSpringDoesWithAnyStepAndIterations) {
    const double compliance = 0.003;  // m/N
    const double mass = 0.2;          // kg
    for (const double step : {0.01, 0.002}) {
        for (const int substeps : {1, 5}) {
            for (const int iterations : {1, 3, 20}) {
                ParticleModel model = hanging_chain(1, mass, compliance);
                ParticleSolver solver(model,
                                      {.step = step, .substeps = substeps, .iterations = iterations, .drag = 20.0});
                for (double t = 0.0; t < 4.0; t += step) {
                    solver.step(model, {});
                }
                EXPECT_NEAR(-model.position[1].y - 0.1, compliance * mass * 9.81, 1e-12)
                    << step << " s, " << substeps << " sub-steps, " << iterations << " iterations";
            }
        }
    }
}

/// Requests a varying number of sub-steps, as contacts do.
class Hasty : public SolverContacts {
  public:
    [[nodiscard]] int substeps(const ParticleModel& /*start*/, double /*step*/) const override { return wanted; }
    void begin(const ParticleModel& /*start*/, ElasticBodies& /*elastic*/, const MovingParticles& /*now*/,
               double /*h*/) override {}
    void project(const ParticleModel& /*start*/, const MovingParticles& /*now*/, double /*h*/) override {}
    void finish(const ParticleModel& /*start*/, const MovingParticles& /*now*/, double /*h*/) override {}
    int wanted = 1;
};

TEST(Solver, ASpringIsIndependentOfTheSubStepsThatContactsRequest) {
    ParticleModel model = hanging_chain(1, 0.2, 0.003);
    model.add({1.0, 0.0, 0.0}, 0.1, 0.1);  // beside it, a compressed body
    model.add({2.0, 0.0, 0.0}, 0.1, 0.1);
    model.groups.push_back({2, {2, 3}, 1.0, 0.004});
    model.bodies = {{0, 2}, {2, 4}};
    ParticleSolver solver(model, {.drag = 20.0});
    Hasty contacts;
    const double weight = 9.81 * 0.1;
    const std::vector<Vec3> force{Vec3(0.0), Vec3(0.0), {0.2, weight, 0.0}, {-0.2, weight, 0.0}};
    for (int i = 0; i < 400; ++i) {
        contacts.wanted = 1 + i % 7;
        solver.step(model, force, {&contacts});
        if (i >= 350) {
            ASSERT_NEAR(-model.position[1].y - 0.1, 0.003 * 0.2 * 9.81, 1e-10) << i;
            ASSERT_NEAR(model.position[2].x - 1.0, 0.004 * 2.0, kRounding) << i;
        }
    }
}

TEST(Solver, AChainOfCompliantLinksStretchesByItsTensions) {
    const std::uint32_t count = 6;
    const double compliance = 0.01;  // m/N
    const double mass = 0.05;        // kg
    struct Effort {
        double step;
        int substeps;
        int iterations;
    };
    // Within 1 % with sub-steps of 0.002 s; two iterations of 0.01 s would leave 11 %.
    for (const auto& [step, substeps, iterations] :
         {Effort{0.01, 1, 5}, Effort{0.01, 1, 40}, Effort{0.002, 1, 2}, Effort{0.01, 5, 2}}) {
        ParticleModel model = hanging_chain(count, mass, compliance);
        ParticleSolver solver(model, {.step = step, .substeps = substeps, .iterations = iterations, .drag = 20.0});
        for (double t = 0.0; t < 8.0; t += step) {
            solver.step(model, {});
        }
        for (std::uint32_t k = 1; k <= count; ++k) {
            const double stretch = model.position[k - 1].y - model.position[k].y - 0.1;
            const double expected = compliance * mass * 9.81 * (count + 1 - k);
            EXPECT_NEAR(stretch, expected, 0.01 * expected)
                << step << " s, " << iterations << " iterations, link " << k;
        }
    }
}

TEST(Solver, ALinkWithoutComplianceDependsOnStepAndIterations) {
    // For comparison, the same chain with stiffness instead of compliance.
    const auto stretch = [](int iterations, double step) {
        ParticleModel model = hanging_chain(1, 0.2, 0.0);
        model.links[0].stiffness = 0.3;
        ParticleSolver solver(model, {.step = step, .iterations = iterations, .drag = 20.0});
        for (double t = 0.0; t < 4.0; t += step) {
            solver.step(model, {});
        }
        return -model.position[1].y - 0.1;
    };
    EXPECT_GT(stretch(1, 0.01), 5.0 * stretch(5, 0.01));
    EXPECT_GT(stretch(1, 0.01), 20.0 * stretch(1, 0.002));
}

TEST(Solver, ACompliantGroupYieldsByForcePerMassWithAnyStepAndIterations) {
    const double compliance = 0.004;  // s^2
    const std::vector<double> mass{0.1, 0.1, 0.3, 0.3};
    // Along and against the line of each pair, so that neither centroid nor orientation changes.
    const std::vector<Vec3> acceleration{{2.0, 0.0, 0.0}, {-2.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, -1.0, 0.0}};
    for (const double step : {0.01, 0.002}) {
        for (const int iterations : {1, 3, 20}) {
            ParticleModel model;
            model.add({1.0, 0.0, 0.0}, mass[0], 0.1);
            model.add({-1.0, 0.0, 0.0}, mass[1], 0.1);
            model.add({0.0, 1.0, 0.0}, mass[2], 0.1);
            model.add({0.0, -1.0, 0.0}, mass[3], 0.1);
            model.groups.push_back({0, {0, 1, 2, 3}, 1.0, compliance});
            std::vector<Vec3> force;
            for (std::size_t i = 0; i < 4; ++i) {
                force.push_back(mass[i] * acceleration[i]);
            }
            SolverSettings settings{.step = step, .iterations = iterations, .gravity = Vec3(0.0), .drag = 20.0};
            ParticleSolver solver(model, settings);
            for (double t = 0.0; t < 4.0; t += step) {
                solver.step(model, force);
            }
            for (std::size_t i = 0; i < 4; ++i) {
                const Vec3 gone = model.position[i] - model.rest_position[i];
                EXPECT_LT(glm::length(gone - compliance * acceleration[i]), 2.0 * kRounding)
                    << step << " s, " << iterations;
            }
        }
    }
}

TEST(Solver, CompliantBodiesKeepTheirMomenta) {
    ParticleModel model = crumpled_sheet();
    for (Group& group : model.groups) {
        group.compliance = 1e-3;
    }
    for (Link& link : model.links) {
        link.compliance = 1e-2;
    }
    ParticleSolver solver(model, kFree);
    const Vec3 linear = linear_momentum(model);
    const Vec3 angular = angular_momentum(model);
    for (int i = 0; i < 500; ++i) {
        solver.step(model, {});
    }
    EXPECT_LT(glm::length(linear_momentum(model) - linear), 1e-12 * glm::length(linear) * 500);
    EXPECT_LT(glm::length(angular_momentum(model) - angular), 1e-11 * glm::length(linear));
}

TEST(Solver, AcceleratesByForceOverMass) {
    ParticleModel model;
    model.add(Vec3(0.0), 2.0, 0.1);
    ParticleSolver solver(model, kFree);
    const std::vector<Vec3> force{{4.0, 0.0, 0.0}};
    solver.step(model, force);
    EXPECT_NEAR(model.velocity[0].x, 0.02, 1e-15);
    EXPECT_NEAR(model.position[0].x, 0.0002, 1e-15);
}

/// A force that grows with time, and how far each body is when it is asked for.
class Growing : public SolverForces {
  public:
    explicit Growing(std::size_t bodies) : seen(bodies), force_(bodies) {}
    std::span<const Vec3> at(const ParticleModel& start, const ParticleRange& body, double elapsed,
                             double /*h*/) noexcept override {
        const std::size_t b = body.begin;  // one particle each
        seen[b].push_back(start.position[b].x);
        force_[b] = Vec3(1.0 + 100.0 * elapsed, 0.0, 0.0);
        return std::span(force_).subspan(b, 1);
    }
    std::vector<std::vector<double>> seen;  // x at each sub-step, m, per body

  private:
    std::vector<Vec3> force_;
};

/// Contacts that may move what they leave alone.
class Careful final : public Hasty {
  public:
    [[nodiscard]] bool secures() const noexcept override { return true; }
};

TEST(Solver, LeadsEachBodyFromOneSubStepToTheNextAndTellsWhereItEnds) {
    ParticleModel model;
    for (int b = 0; b < 5; ++b) {
        model.add(Vec3(0.3 * b, 0.0, 0.0), 2.0, 0.1);
    }
    for (std::uint32_t b = 0; b < 5; ++b) {
        model.bodies.push_back({b, b + 1});
    }
    ParticleSolver solver(model, {.step = 0.03, .substeps = 3, .gravity = Vec3(0.0), .threads = 3});
    Hasty contacts;
    Careful careful;
    for (SolverContacts* const last :
         {static_cast<SolverContacts*>(&contacts), static_cast<SolverContacts*>(&careful)}) {
        const ParticleModel before = model;
        Growing forces(5);
        std::vector<std::vector<double>> ends(5);
        solver.step(model, forces, {last}, [&](std::size_t b) { ends[b].push_back(model.position[b].x); });
        for (std::size_t b = 0; b < 5; ++b) {
            // Semi-implicit, with 1, 2 and 3 N.
            double x = before.position[b].x;
            double v = before.velocity[b].x;
            ASSERT_EQ(forces.seen[b].size(), 3U);
            for (std::size_t s = 0; s < 3; ++s) {
                EXPECT_NEAR(forces.seen[b][s], x, 1e-15) << "body " << b << ", sub-step " << s;
                v += 0.01 * (1.0 + static_cast<double>(s)) / 2.0;
                x += 0.01 * v;
            }
            EXPECT_NEAR(model.position[b].x, x, 1e-15);
            EXPECT_EQ(ends[b], std::vector<double>{model.position[b].x});
        }
    }
}

/// Particles in one group about the first, or with a group about each.
ParticleModel matched(const std::vector<Vec3>& rest, std::size_t centres) {
    ParticleModel model;
    Group group{0, {}, 1.0};
    for (std::uint32_t i = 0; i < rest.size(); ++i) {
        model.add(rest[i], 1.0 + 0.5 * i, 0.05);
        group.members.push_back(i);
    }
    for (; group.centre < centres; ++group.centre) {
        model.groups.push_back(group);
    }
    return model;
}

/// Whether the model is a proper rigid transform of its rest shape, by distances and, for groups with a volume,
/// handedness.
void expect_rest_shape(const ParticleModel& model, double tolerance) {
    const auto& x = model.position;
    const auto& rest = model.rest_position;
    for (std::size_t i = 0; i < x.size(); ++i) {
        for (std::size_t k = 0; k < i; ++k) {
            EXPECT_NEAR(glm::length(x[i] - x[k]), glm::length(rest[i] - rest[k]), tolerance) << i << " to " << k;
        }
    }
    const auto volume = [](const std::vector<Vec3>& p) {
        return glm::dot(p[1] - p[0], glm::cross(p[2] - p[0], p[3] - p[0]));
    };
    if (x.size() >= 4) {
        EXPECT_NEAR(volume(x), volume(rest), 10.0 * tolerance);
    }
    for (const Quat& q : model.orientation) {
        EXPECT_NEAR(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z, 1.0, 1e-12);
    }
}

ParticleModel settled(ParticleModel model) {
    SolverSettings settings = kFree;
    settings.drag = 20.0;
    ParticleSolver solver(model, settings);
    for (int i = 0; i < 200; ++i) {
        solver.step(model, {});
    }
    EXPECT_TRUE(is_finite(model));
    return model;
}

const std::vector<Vec3> kSolid{{0, 0, 0}, {1, 0, 0}, {0, 0.8, 0}, {0, 0, 0.6}, {0.5, 0.4, 0.3}};
const std::vector<Vec3> kFlat{{0, 0, 0}, {1, 0, 0}, {0, 0.8, 0}, {0.7, 0.7, 0}};
const std::vector<Vec3> kLine{{0, 0, 0}, {1, 0, 0}, {2.5, 0, 0}};

TEST(Solver, AnInvertedGroupTurnsRightSideOut) {
    for (int axis = 0; axis < 3; ++axis) {
        ParticleModel model = matched(kSolid, kSolid.size());
        for (Vec3& x : model.position) {
            x[axis] = -x[axis];
        }
        expect_rest_shape(settled(model), 8.0 * kRounding);
    }
}

TEST(Solver, AGroupCompressedToAPlaneALineOrAPointRecoversItsShape) {
    for (const auto& [y, z] : {std::pair{1.0, 0.0}, {0.0, 0.0}}) {
        ParticleModel model = matched(kSolid, kSolid.size());
        for (Vec3& x : model.position) {
            x = {x.x, y * x.y, z * x.z};
        }
        expect_rest_shape(settled(model), 8.0 * kRounding);
    }
    ParticleModel model = matched(kSolid, kSolid.size());
    std::fill(model.position.begin(), model.position.end(), Vec3(0.3));
    expect_rest_shape(settled(model), 8.0 * kRounding);
}

TEST(Solver, GroupsThatAreFlatOrCollinearAtRestReturnFromAnyState) {
    std::mt19937 random(11);
    std::normal_distribution<double> normal;
    const auto vector = [&] { return Vec3{normal(random), normal(random), normal(random)}; };
    for (const std::vector<Vec3>& rest : {kFlat, kLine, kSolid}) {
        for (int trial = 0; trial < 50; ++trial) {
            ParticleModel model = matched(rest, rest.size());
            for (std::size_t i = 0; i < model.size(); ++i) {
                model.position[i] = vector();
                model.orientation[i] = turned(model.orientation[i], 3.0 * vector());
            }
            expect_rest_shape(settled(model), 8.0 * 2.5 * kRounding);
        }
    }
}

TEST(Solver, ARotatedFlatOrCollinearGroupStaysAtRest) {
    const Quat turn = glm::angleAxis(2.2, glm::normalize(Vec3(0.3, -1.0, 0.5)));
    for (const std::vector<Vec3>& rest : {kFlat, kLine}) {
        ParticleModel model = matched(rest, rest.size());
        for (std::size_t i = 0; i < model.size(); ++i) {
            model.position[i] = turn * rest[i];
            model.orientation[i] = turn;
        }
        const ParticleModel after = settled(model);
        for (std::size_t i = 0; i < model.size(); ++i) {
            EXPECT_LT(glm::length(after.position[i] - turn * rest[i]), 8.0 * 2.5 * kRounding);
        }
        EXPECT_NEAR(std::abs(glm::dot(after.orientation[0], turn)), 1.0, 32.0 * kRounding * kRounding);
    }
}

TEST(Solver, OrientationsDetermineTheTwistOfACollinearGroup) {
    // Collinear positions do not determine the twist: without orientations the moment matrix would be singular.
    ParticleModel model = matched(kLine, 1);
    const Quat twist = glm::angleAxis(0.9, Vec3(1.0, 0.0, 0.0));
    model.orientation[1] = model.orientation[2] = twist;
    const Quat found = settled(model).orientation[0];
    const Quat half_way = glm::angleAxis(0.45, Vec3(1.0, 0.0, 0.0));
    EXPECT_NEAR(found.y, 0.0, 1e-12);
    EXPECT_NEAR(found.z, 0.0, 1e-12);
    EXPECT_GT(std::abs(glm::dot(found, twist)), std::abs(glm::dot(half_way, twist)));  // two of three are twisted
}

TEST(Solver, AGroupOfASingleParticleFollowsIt) {
    for (const double radius : {0.05, 0.0}) {
        ParticleModel model;
        model.add(Vec3(0.0), 2.0, radius);
        model.groups.push_back({0, {0}, 1.0});
        model.position[0] = {1.0, 2.0, 3.0};
        model.velocity[0] = {0.0, 1.0, 0.0};
        model.angular_velocity[0] = {0.0, 0.0, 2.0};
        ParticleSolver solver(model, kFree);
        Quat turn = model.orientation[0];
        for (int i = 0; i < 50; ++i) {
            solver.step(model, {});
            turn = turned(turn, {0.0, 0.0, 0.02});
        }
        EXPECT_LT(glm::length(model.position[0] - Vec3(1.0, 2.5, 3.0)), 1e-12);
        // The rotation is rounded five times in each of 50 steps; the rate is that of the last step.
        const double lag = 5 * 50 * kRounding;  // rad
        EXPECT_NEAR(std::abs(glm::dot(model.orientation[0], turn)), 1.0, 0.125 * lag * lag) << "radius " << radius;
        EXPECT_NEAR(model.angular_velocity[0].z, 2.0, 5 * kRounding / kFree.step);
    }
}

TEST(Solver, ReturnsAFlatSheetToItsShape) {
    ParticleModel model = crumpled_sheet();
    SolverSettings settings = kFree;
    settings.drag = 5.0;
    ParticleSolver solver(model, settings);
    for (int i = 0; i < 500; ++i) {
        solver.step(model, {});
    }
    for (const Link& link : model.links) {
        EXPECT_NEAR(glm::length(model.position[link.second] - model.position[link.first]), link.rest_length, 1e-4);
    }
}

TEST(Solver, UsesTheMinimumNumberOfColours) {
    const ParticleModel model = make_cloth_particles({}, 1.0, 1.0);
    const ParticleSolver solver(model, {});
    // A particle is in nine groups and has eight links, so that many colours are the minimum.
    EXPECT_GE(solver.group_colours(), 9u);
    EXPECT_LE(solver.group_colours(), 16u);
    EXPECT_GE(solver.link_colours(), 8u);
    EXPECT_LE(solver.link_colours(), 12u);
}

TEST(Solver, RefusesInvalidModelsAndSettings) {
    ParticleModel model = sheet();
    EXPECT_THROW(ParticleSolver(model, {.step = 0.0}), std::invalid_argument);
    EXPECT_THROW(ParticleSolver(model, {.substeps = -1}), std::invalid_argument);
    EXPECT_THROW(ParticleSolver(model, {.drag = 200.0}), std::invalid_argument);
    model.links[3].second = 5000;
    EXPECT_THROW(ParticleSolver(model, {}), std::invalid_argument);
    model = sheet();
    model.groups[2].members.push_back(model.groups[2].members.front());
    EXPECT_THROW(ParticleSolver(model, {}), std::invalid_argument);
    model = sheet();
    model.position[1].x = std::nan("");
    EXPECT_THROW(ParticleSolver(model, {}), std::invalid_argument);
}

}  // namespace
}  // namespace haptic::sim
