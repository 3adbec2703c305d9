#include "haptic/sim/collisions.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <random>
#include <span>
#include <stdexcept>
#include <vector>

#include "clouds.hpp"
#include "collision/ellipsoids.hpp"
#include "haptic/denormals.hpp"
#include "haptic/sim/solver.hpp"
#include "scene/state_hash.hpp"

namespace haptic::sim {
namespace {

constexpr SolverSettings kFloating{.gravity = {0.0, 0.0, 0.0}};

/// A body of one particle.
ParticleModel lone(const Vec3& where, const Vec3& velocity, const Vec3& semi_axes, double mass = 0.01) {
    ParticleModel model;
    model.add(where, mass, 0.01);
    model.semi_axes[0] = semi_axes;
    model.velocity[0] = velocity;
    return model;
}

ParticleModel together(std::span<const ParticleModel> parts) {
    ParticleModel model;
    for (const ParticleModel& part : parts) {
        model.append(part);
    }
    return model;
}

/// Steps a model with its collisions.
class Stepping {
  public:
    Stepping(const ParticleModel& start, const SolverSettings& solver, const CollisionSettings& settings)
        : model(start), collisions(start, settings), solver_(start, solver) {}
    void step(int steps = 1) {
        const FlushDenormals flush;
        for (int i = 0; i < steps; ++i) {
            solver_.step(model, {}, {&collisions});
        }
    }
    ParticleModel model;
    ParticleCollisions collisions;

  private:
    ParticleSolver solver_;
};

Vec3 centre(const ParticleModel& model, std::size_t body) {
    Vec3 sum(0.0);
    for (std::size_t i = model.bodies[body].begin; i < model.bodies[body].end; ++i) {
        sum += model.position[i];
    }
    return sum / static_cast<double>(model.bodies[body].end - model.bodies[body].begin);
}

std::uint32_t body_of(const ParticleModel& model, std::size_t particle) {
    std::uint32_t body = 0;
    while (particle >= model.bodies[body].end) {
        ++body;
    }
    return body;
}

EllipsoidShape shape_now(const ParticleModel& model, std::size_t i) {
    return shape_of(model.semi_axes[i], model.orientation[i] * model.axes[i]);
}

/// The deepest overlap of two particles of different bodies, relative to the distance at which they would touch.
double deepest(const ParticleModel& model) {
    double worst = 0.0;
    for (std::size_t a = 0; a < model.size(); ++a) {
        for (std::size_t b = 0; b < a; ++b) {
            const Vec3 c = model.position[a] - model.position[b];
            const double size = glm::length(model.semi_axes[a]) + glm::length(model.semi_axes[b]);
            if (body_of(model, a) == body_of(model, b) || glm::length(c) > size) {
                continue;
            }
            const EllipsoidShape first = shape_now(model, a);
            const EllipsoidShape second = shape_now(model, b);
            const Vec3 n = separating_normal({first, second, 1.0, c, c});
            worst = std::max(worst, 1.0 - glm::dot(n, c) / (reach_of(first, n) + reach_of(second, n)));
        }
    }
    return worst;
}

double lowest(const ParticleModel& model) {
    double y = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < model.size(); ++i) {
        y = std::min(y, model.position[i].y - std::sqrt(shape_now(model, i).yy));
    }
    return y;
}

TEST(Collisions, StopTwoThatMeetHeadOnHoweverFast) {
    for (const double speed : {0.1, 1.0, 5.0, 50.0, 1000.0}) {
        const std::vector<ParticleModel> pair{lone({0.0, 0.0, 0.0}, {speed, 0.0, 0.0}, Vec3(0.01)),
                                              lone({0.1, 0.0, 0.0}, {-speed, 0.0, 0.0}, Vec3(0.01), 0.03)};
        Stepping run(together(pair), kFloating, {.max_substeps = 1});
        const Vec3 momentum = linear_momentum(run.model);
        run.step(100);
        const double distance = run.model.position[1].x - run.model.position[0].x;
        EXPECT_NEAR(distance, 0.02, 1e-9) << speed;
        EXPECT_LT(glm::length(linear_momentum(run.model) - momentum), 1e-12 * speed);
        // Restitution is 0: they continue together.
        EXPECT_NEAR(run.model.velocity[0].x, -0.5 * speed, 1e-9 * speed);
        EXPECT_NEAR(run.model.velocity[1].x, -0.5 * speed, 1e-9 * speed);
    }
}

/// Sampled result of a random fast passage, seen from the other particle.
struct Encounter {
    bool touches = false;
    bool misses = true;  // by a good part of their size
};

Encounter sample(const Vec3& from, const Vec3& path, const Vec3& semi_axes) {
    Encounter seen;
    for (int k = 0; k <= 200; ++k) {
        // Two ellipsoids of equal shape and orientation touch on one of twice their size.
        const double level = glm::length((from + (k / 200.0) * path) / (2.0 * semi_axes));
        seen.touches = seen.touches || level < 1.0;
        seen.misses = seen.misses && level > 1.05;
    }
    return seen;
}

TEST(Collisions, KeepTheSideOfWhatTheyTouchInAStepAndLeaveWhatPassesAlone) {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    const auto vector = [&] {
        const double x = unit(random), y = unit(random), z = unit(random);
        return Vec3(x, y, z);
    };
    int touched = 0;
    int missed = 0;
    for (int k = 0; k < 3000; ++k) {
        const Vec3 semi_axes = 0.01 * (Vec3(2.0) + vector());
        const Vec3 from = 0.1 * vector();
        const Vec3 velocity = (-0.5 - 2.0 * std::abs(unit(random))) / 0.01 * from + 6.0 * vector();
        if (glm::length(from / (2.0 * semi_axes)) < 1.05) {
            continue;
        }
        const Vec3 common = 10.0 * vector();
        const std::vector<ParticleModel> pair{lone(from, common + velocity, semi_axes),
                                              lone(Vec3(0.0), common, semi_axes)};
        Stepping run(together(pair), kFloating, {.static_friction = 0.5, .dynamic_friction = 0.4, .max_substeps = 1});
        const Encounter seen = sample(from, kFloating.step * velocity, semi_axes);
        run.step();
        const Vec3 to = run.model.position[0] - run.model.position[1];
        if (seen.touches) {
            ++touched;
            ASSERT_GT(glm::length(to / (2.0 * semi_axes)), 1.0 - 1e-9) << k;
            ASSERT_FALSE(sample(from, to - from, 0.999 * semi_axes).touches) << k;  // not on the path either
        } else if (seen.misses) {
            ++missed;
            ASSERT_LT(glm::length(run.model.velocity[0] - common - velocity), 1e-10) << k;
        }
    }
    EXPECT_GT(touched, 300);
    EXPECT_GT(missed, 300);
}

TEST(Collisions, HoldBackWhatFollowsOneThatIsStopped) {
    // Both fall at ten radii a step; only the lower one meets the ground in this step.
    const std::vector<ParticleModel> pair{lone({0.0, 0.03, 0.0}, {0.0, -10.0, 0.0}, Vec3(0.01)),
                                          lone({0.0, 0.06, 0.0}, {0.0, -10.0, 0.0}, Vec3(0.01))};
    Stepping run(together(pair), kFloating, {.ground = true, .max_substeps = 1});
    run.step();
    EXPECT_NEAR(run.model.position[0].y, 0.01, 1e-12);
    EXPECT_GE(run.model.position[1].y, 0.03 - 0.05 * 0.01);  // the passes leave 5 % of a size
}

TEST(Collisions, HappenBetweenEllipsoidsAsTheyAreOriented) {
    // Long ellipsoids side by side, closer than their length; the second one is then rotated across.
    const Vec3 axes(0.03, 0.005, 0.005);
    std::vector<ParticleModel> pair{lone({0.0, 0.0, 0.0}, {0.0, 0.0, 1.0}, axes),
                                    lone({0.0, 0.0, 0.02}, Vec3(0.0), axes)};
    Stepping beside(together(pair), kFloating, {});
    beside.step();
    EXPECT_NEAR(beside.model.position[1].z - beside.model.position[0].z, 0.01, 1e-9);
    pair[1].orientation[0] = glm::angleAxis(1.5707963267948966, Vec3(0.0, 1.0, 0.0));
    pair[1].position[0].z = pair[1].rest_position[0].z = 0.04;
    Stepping across(together(pair), kFloating, {});
    across.step();
    EXPECT_NEAR(across.model.position[1].z - across.model.position[0].z, 0.035,
                0.06 * 0x1p-24);  // rotated in single precision
}

TEST(Collisions, RestOnTheGroundAtTheReachOfTheRotatedEllipsoid) {
    for (const double height : {0.0, -3.0}) {
        ParticleModel model = lone({0.0, height + 1.0, 0.0}, {0.0, -300.0, 0.0}, {0.03, 0.01, 0.01});
        model.axes[0] = glm::angleAxis(0.5, Vec3(0.0, 0.0, 1.0));
        Stepping run(model, {}, {.ground = true, .ground_height = height});
        for (int i = 0; i < 20; ++i) {
            run.step();
            ASSERT_GT(lowest(run.model), height - 1e-12);
        }
        const double reach = std::hypot(0.03 * std::sin(0.5), 0.01 * std::cos(0.5));
        EXPECT_NEAR(run.model.position[0].y, height + reach, 1e-12);
        EXPECT_LT(glm::length(run.model.velocity[0]), 1e-9);
    }
}

/// Where the ground's friction brings a slider to rest, and when, by Coulomb's law.
TEST(Collisions, LetTheGroundBrakeASliderByCoulombsLaw) {
    const double dynamic = 0.3;
    const double speed = 2.0;
    const ParticleModel model = lone({0.0, 0.01, 0.0}, {speed, 0.0, 0.0}, Vec3(0.01));
    Stepping run(model, {.step = 0.001}, {.ground = true, .static_friction = 0.4, .dynamic_friction = dynamic});
    run.step(300);
    EXPECT_NEAR(run.model.velocity[0].x, speed - dynamic * 9.81 * 0.3, 0.01 * speed);
    run.step(1000);
    EXPECT_LT(glm::length(run.model.velocity[0]), 1e-9);
    EXPECT_NEAR(run.model.position[0].x, speed * speed / (2.0 * dynamic * 9.81), 0.01);
}

TEST(Collisions, HoldASlopeUpToStaticFrictionAndSlideBeyondByDynamicFriction) {
    const CollisionSettings settings{.ground = true, .static_friction = 0.5, .dynamic_friction = 0.3};
    for (const double slope : {0.45, 0.6}) {
        const double angle = std::atan(slope);
        const SolverSettings solver{.step = 0.001, .gravity = 9.81 * Vec3(std::sin(angle), -std::cos(angle), 0.0)};
        Stepping run(lone({0.0, 0.01, 0.0}, Vec3(0.0), Vec3(0.01)), solver, settings);
        run.step(500);
        const double expected = slope < 0.5 ? 0.0 : 9.81 * (std::sin(angle) - 0.3 * std::cos(angle)) * 0.5;
        EXPECT_NEAR(run.model.velocity[0].x, expected, 0.01 * expected + 1e-9);
    }
}

TEST(Collisions, LetBodiesDragOneAnotherByFriction) {
    // A light body lies on a heavy one, as if on a pinned one: it is moved sideways while gravity presses.
    std::vector<ParticleModel> pair{lone({0.0, 0.11, 0.0}, Vec3(0.0), Vec3(0.01)),
                                    lone({0.0, 0.0, 0.0}, {0.5, 0.0, 0.0}, {1.0, 0.1, 1.0})};
    pair[1].pinned[0] = 1;
    Stepping with(together(pair), {.step = 0.001}, {.static_friction = 0.4, .dynamic_friction = 0.3});
    Stepping without(together(pair), {.step = 0.001}, {});
    with.step(100);
    without.step(100);
    EXPECT_NEAR(with.model.velocity[0].x, 0.3 * 9.81 * 0.1, 0.02);
    EXPECT_NEAR(without.model.velocity[0].x, 0.0, 0.01);
    with.step(400);
    EXPECT_NEAR(with.model.velocity[0].x, 0.5, 0.02);
    EXPECT_EQ(with.model.velocity[1], Vec3(0.5, 0.0, 0.0));
}

ParticleModel two_clouds(double speed) {
    const std::vector<ParticleModel> parts{
        moved(make_cloud({.particles = 60}, 1), {0.0, 0.14, 0.0}, {0.3, -speed, 0.0}),
        moved(make_cloud({.particles = 60, .mass = 0.7}, 2), Vec3(0.0), {0.0, speed, 0.1})};
    return together(parts);
}

TEST(Collisions, KeepLinearMomentumToRounding) {
    const ParticleModel start = two_clouds(2.0);
    Stepping run(start, kFloating, {.static_friction = 0.6, .dynamic_friction = 0.5});
    std::size_t active = 0;
    for (int i = 0; i < 50; ++i) {
        run.step();
        active += run.collisions.counts().active;
    }
    EXPECT_GT(active, 30u);
    // Each of up to 8 sub-steps of 50 steps divides differences of positions of 1 m by h: 1 kg * 2^-53 m / 1 ms.
    EXPECT_LT(glm::length(linear_momentum(run.model) - linear_momentum(start)), 400 * 0x1p-53 / 1e-3);
    EXPECT_LT(kinetic_energy(run.model), 0.5 * kinetic_energy(start));
}

TEST(Collisions, ResolveAnOverlapNoFasterThanPushOutSpeed) {
    for (const double speed : {0.0, 0.05, 1.0}) {
        const std::vector<ParticleModel> pair{lone({0.0, 0.0, 0.0}, Vec3(0.0), Vec3(0.01)),
                                              lone({0.004, 0.0, 0.0}, Vec3(0.0), Vec3(0.01))};
        Stepping run(together(pair), kFloating, {.push_out_speed = speed});
        double before = 0.004;
        for (int i = 0; i < 100; ++i) {
            run.step();
            const double distance = run.model.position[1].x - run.model.position[0].x;
            EXPECT_LE(distance - before, speed * 0.01 + 1e-12);
            before = distance;
        }
        const double speed_left = 0.5 * glm::length(run.model.velocity[1] - run.model.velocity[0]);
        EXPECT_LE(speed_left, 0.5 * speed + 1e-12);
        EXPECT_GT(before, speed > 0.0 ? 0.02 - 1e-12 : 0.004 - 1e-12);
    }
}

/// Three bodies above one another that do not touch yet.
ParticleModel heap_to_be(std::uint32_t seed) {
    std::vector<ParticleModel> parts;
    parts.reserve(3);
    for (std::uint32_t b = 0; b < 3; ++b) {
        parts.push_back(
            moved(make_cloud({.particles = 40}, 3 * seed + b), {0.01 * b, 0.07 + 0.13 * b, 0.0}, Vec3(0.0)));
    }
    return together(parts);
}

TEST(Collisions, GiveNoEnergyToWhatFallsIntoAHeap) {
    const auto energy = [](const ParticleModel& model) {
        double sum = kinetic_energy(model);
        for (std::size_t i = 0; i < model.size(); ++i) {
            sum += 9.81 * model.mass[i] * model.position[i].y;
        }
        return sum;
    };
    for (const std::uint32_t seed : {1u, 2u, 3u, 4u, 5u}) {
        const ParticleModel start = heap_to_be(seed);
        Stepping run(start, {}, {.ground = true, .static_friction = 0.5, .dynamic_friction = 0.4});
        run.step(400);  // the energy stored in the deformation returns
        double min_energy = energy(run.model);
        for (int i = 0; i < 400; ++i) {
            run.step();
            min_energy = std::min(min_energy, energy(run.model));
            // Each particle of a heap falls by g h^2 in a step before it is held: mass * g * g h^2 is 9 mJ.
            ASSERT_LT(energy(run.model), min_energy + 9e-3) << seed << " at step " << i;
            ASSERT_GT(lowest(run.model), -1e-3) << seed;
        }
        EXPECT_LT(min_energy, 0.5 * energy(start)) << seed;
        EXPECT_LT(kinetic_energy(run.model), 5e-3) << seed;
        EXPECT_LT(deepest(run.model), 0.1) << seed;
    }
}

TEST(Collisions, OfBodiesThrownTogetherLeaveEachOnItsSide) {
    // Broadside, so that neither can slide past the other.
    for (const double speed : {1.0, 3.0, 6.0}) {
        Stepping run(two_clouds(speed), kFloating, {.static_friction = 0.3, .dynamic_friction = 0.2});
        double worst = 0.0;
        for (int i = 0; i < 12; ++i) {
            run.step();
            worst = std::max(worst, deepest(run.model));
            ASSERT_GT(centre(run.model, 0).y, centre(run.model, 1).y + 0.02) << speed;
        }
        EXPECT_LT(worst, 0.3) << speed;
        EXPECT_TRUE(is_finite(run.model));
    }
}

TEST(Collisions, DivideAStepOnlyWhereBodiesMeetFast) {
    const auto needed = [](const ParticleModel& model, const CollisionSettings& settings) {
        return ParticleCollisions(model, settings).substeps(model, 0.01);
    };
    const auto pair = [](double distance, double speed) {
        const std::vector<ParticleModel> parts{lone(Vec3(0.0), {speed, 0.0, 0.0}, Vec3(0.01)),
                                               lone({distance, 0.0, 0.0}, {-speed, 0.0, 0.0}, Vec3(0.01))};
        return together(parts);
    };
    EXPECT_EQ(needed(pair(0.05, 1.0), {}), 1);  // 2 radii nearer in a step
    EXPECT_EQ(needed(pair(0.05, 5.0), {}), 4);  // 10 radii
    EXPECT_EQ(needed(pair(5.0, 5.0), {}), 1);   // far away
    EXPECT_EQ(needed(pair(0.05, 500.0), {.max_substeps = 6}), 6);
    EXPECT_EQ(needed(pair(0.05, 5.0), {.between_bodies = false}), 1);
    const ParticleModel falling = lone({0.0, 0.05, 0.0}, {0.0, -5.0, 0.0}, Vec3(0.01));
    EXPECT_EQ(needed(falling, {.ground = true}), 2);
    EXPECT_EQ(needed(falling, {.ground = true, .ground_height = -1.0}), 1);
}

TEST(Collisions, LeaveOutTheOwnBodyAndWhatHasNoExtent) {
    ParticleModel model = lone(Vec3(0.0), {1.0, 0.0, 0.0}, Vec3(0.01));
    model.add({0.005, 0.0, 0.0}, 0.01, 0.01);
    model.semi_axes[1] = Vec3(0.01);
    const std::vector<ParticleModel> parts{model, lone({0.0, 0.005, 0.0}, {0.0, -1.0, 0.0}, Vec3(0.0))};
    Stepping run(together(parts), kFloating, {});
    run.step(10);
    EXPECT_NEAR(run.model.velocity[0].x, 1.0, 1e-12);
    EXPECT_NEAR(glm::length(run.model.velocity[1]), 0.0, 1e-12);
    EXPECT_NEAR(run.model.velocity[2].y, -1.0, 1e-12);
    EXPECT_EQ(run.collisions.counts().planes, 0u);
}

TEST(Collisions, DoNotMoveWhatIsPinned) {
    std::vector<ParticleModel> pair{lone({-0.0, 0.0, -0.0}, Vec3(0.0), Vec3(0.01)),
                                    lone({0.0, 0.05, 0.0}, {0.0, -8.0, 0.0}, Vec3(0.01))};
    pair[0].pinned[0] = 1;
    Stepping run(together(pair), {}, {.static_friction = 0.5, .dynamic_friction = 0.5});
    run.step(50);
    EXPECT_EQ(run.model.position[0], Vec3(0.0));
    EXPECT_TRUE(std::signbit(run.model.position[0].x));  // nothing was added, not even 0
    EXPECT_NEAR(run.model.position[1].y, 0.02, 1e-9);
}

TEST(Collisions, OfManyBodiesAreFoundAsThoseOfFew) {
    // More bodies than are clipped: a row of balls; the first one hits the rest.
    std::vector<ParticleModel> row;
    row.reserve(100);
    for (int k = 0; k < 100; ++k) {
        row.push_back(lone({0.021 * k, 0.0, 0.0}, Vec3(0.0), Vec3(0.01)));
    }
    row[0].velocity[0].x = 1.0;
    Stepping run(together(row), kFloating, {});
    run.step(400);
    for (std::size_t k = 1; k < 100; ++k) {
        ASSERT_GT(run.model.position[k].x - run.model.position[k - 1].x, 0.02 - 1e-5) << k;
    }
    EXPECT_GT(run.model.velocity[10].x, 0.0);
}

TEST(Collisions, GiveTheSameBitsTwiceWithAnyNumberOfLanes) {
    const auto hash = [](std::size_t solver_lanes, std::size_t lanes) {
        const FlushDenormals flush;
        std::vector<ParticleModel> parts{two_clouds(3.0),
                                         moved(make_cloud({.particles = 43}, 3), {0.02, 0.0, 0.1}, {0.0, 0.0, -2.0})};
        ParticleModel model = together(parts);
        ParticleSolver solver(model, {}, solver_lanes);
        ParticleCollisions collisions(model, {.ground = true, .ground_height = -0.1, .static_friction = 0.5}, nullptr,
                                      lanes);
        StateHash state;
        for (int i = 0; i < 30; ++i) {
            solver.step(model, {}, {&collisions});
            const std::array<std::size_t, 2> counts{collisions.counts().near, collisions.counts().planes};
            state.add(std::span<const std::size_t>(counts));
        }
        state.add(std::span<const Vec3>(model.position));
        state.add(std::span<const Vec3>(model.velocity));
        return state.value();
    };
    const std::uint64_t first = hash(1, 1);
    for (const std::size_t lanes : ParticleSolver::usable_lanes()) {
        EXPECT_EQ(hash(lanes, 1), first) << lanes;
    }
    for (const std::size_t lanes : ParticleCollisions::usable_lanes()) {
        EXPECT_EQ(hash(1, lanes), first) << lanes;
    }
    EXPECT_EQ(hash(ParticleSolver::kWidest, ParticleCollisions::kWidest), first);
}

TEST(Collisions, HaveOnlyTheLanesOfTheMachine) {
    const ParticleModel model = two_clouds(1.0);
    EXPECT_THROW(ParticleCollisions(model, {}, nullptr, 3), std::invalid_argument);
    EXPECT_EQ(ParticleCollisions::usable_lanes().front(), 1u);
}

TEST(Collisions, OfNothingAreNone) {
    Stepping run(ParticleModel{}, {}, {.ground = true});
    run.step();
    EXPECT_EQ(run.collisions.counts().near, 0u);
}

TEST(Collisions, SayWhichSettingIsWrong) {
    const ParticleModel model = lone(Vec3(0.0), Vec3(0.0), Vec3(0.01));
    const double nan = std::numeric_limits<double>::quiet_NaN();
    for (const CollisionSettings& wrong :
         {CollisionSettings{.ground_height = nan}, CollisionSettings{.static_friction = -0.1},
          CollisionSettings{.static_friction = 0.1, .dynamic_friction = 0.2}, CollisionSettings{.push_out_speed = -1.0},
          CollisionSettings{.push_out_speed = nan}, CollisionSettings{.max_substeps = 0},
          CollisionSettings{.max_substeps = 101}}) {
        EXPECT_THROW(ParticleCollisions(model, wrong), std::invalid_argument);
    }
}

}  // namespace
}  // namespace haptic::sim
