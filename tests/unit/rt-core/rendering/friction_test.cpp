#include "rendering/friction.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <span>
#include <vector>

#include "random.hpp"

namespace haptic::rt {
namespace {

constexpr Friction kRough{0.8, 0.5};
constexpr double kDepth = 0.004;  // m

using Planes = std::vector<HalfSpace>;

/// Position of the particle for a goal, after one tick.
Vec3 tick(const Vec3& goal, const Planes& planes, FrictionState& state, const Vec3& surface_displacement = Vec3(0.0),
          const Friction& friction = kRough) {
    const LocalProxy proxy = project(goal, planes);
    return proxy.position + apply_friction(proxy, goal, planes, friction, surface_displacement, state);
}

Planes floor_plane() {
    return {{Vec3(0, 1, 0), 0.0}};
}

TEST(FrictionState, IsClearedWithoutFrictionOrContact) {
    FrictionState state;
    state.in_contact = true;
    state.position = Vec3(1.0);
    const LocalProxy held = project(Vec3(0, -kDepth, 0), floor_plane());
    EXPECT_EQ(apply_friction(held, Vec3(0, -kDepth, 0), floor_plane(), {}, Vec3(0.1), state), Vec3(0.0));
    EXPECT_FALSE(state.in_contact);
    state.in_contact = true;
    const LocalProxy free = project(Vec3(0, kDepth, 0), floor_plane());
    EXPECT_EQ(apply_friction(free, Vec3(0, kDepth, 0), floor_plane(), kRough, Vec3(0.1), state), Vec3(0.0));
    EXPECT_FALSE(state.in_contact);
}

TEST(FrictionState, SticksInTheStaticConeAndSlidesOnTheDynamicOneUntilItRests) {
    FrictionState state;
    const Planes planes = floor_plane();
    const Vec3 direction(0.6, 0.0, 0.8);
    const auto under = [&](double x) { return x * direction + Vec3(0, -kDepth, 0); };
    const Vec3 landed = tick(under(0.0), planes, state);
    double x = 0.0;
    while (x < 0.999 * kRough.mu_static * kDepth) {
        ASSERT_LT(glm::length(tick(under(x), planes, state) - landed), 1e-15);
        x += 1e-4;
    }
    for (x = 1.001 * kRough.mu_static * kDepth; x < 0.02; x += 1e-4) {
        const double behind = x - glm::dot(tick(under(x), planes, state), direction);
        ASSERT_NEAR(behind, kRough.mu_dynamic * kDepth, 1e-12);
        ASSERT_TRUE(state.sliding);
    }
    const Vec3 rest = tick(under(x), planes, state);
    (void)tick(under(x), planes, state);
    EXPECT_FALSE(state.sliding);
    x += 0.9 * (kRough.mu_static - kRough.mu_dynamic) * kDepth;
    EXPECT_LT(glm::length(tick(under(x), planes, state) - rest), 1e-15) << "the static coefficient applies again";
}

TEST(FrictionState, MovesWithTheSurfaceUntilTheGoalLeavesTheCone) {
    FrictionState state;
    const Vec3 goal(0, -kDepth, 0);
    (void)tick(goal, floor_plane(), state);
    double gone = 0.0;
    for (int k = 0; k < 100; ++k) {
        const Vec3 surface_displacement(1e-4, 3e-5, 0.0);  // the normal component is ignored
        gone += surface_displacement.x;
        const Vec3 at = tick(goal, floor_plane(), state, surface_displacement);
        ASSERT_NEAR(at.y, 0.0, 1e-15);
        if (gone < kRough.mu_static * kDepth - 1e-9) {
            ASSERT_NEAR(at.x, gone, 1e-12);
        } else if (gone > kRough.mu_static * kDepth + 2e-4) {
            ASSERT_NEAR(at.x, kRough.mu_dynamic * kDepth, 1e-12);
        }
    }
}

TEST(FrictionState, AddsTheForcesOfBothWallsOfAGroove) {
    const double h = std::sqrt(0.5);
    const Planes groove{{Vec3(h, h, 0), 0.0}, {Vec3(-h, h, 0), 0.0}};
    FrictionState state;
    (void)tick({0, -kDepth, 0}, groove, state);
    const double load = std::sqrt(2.0) * kDepth;  // two walls, each with depth / sqrt(2)
    EXPECT_NEAR(tick({0, -kDepth, 0.99 * kRough.mu_static * load}, groove, state).z, 0.0, 1e-15);
    const double z = 3.0 * load;
    EXPECT_NEAR(z - tick({0, -kDepth, z}, groove, state).z, kRough.mu_dynamic * load, 1e-12);
}

TEST(FrictionState, IsZeroInACornerAndUnaffectedByCoincidentPlanes) {
    const Planes corner{{Vec3(1, 0, 0), 0.0}, {Vec3(0, 1, 0), 0.0}, {Vec3(0, 0, 1), 0.0}};
    FrictionState state;
    (void)tick(Vec3(-kDepth), corner, state);
    EXPECT_LT(glm::length(tick({-kDepth, -2 * kDepth, -3 * kDepth}, corner, state)), 1e-15);
    const Planes twice{{Vec3(0, 1, 0), 0.0}, {Vec3(0, 1, 0), 0.0}};
    state = {};
    (void)tick({0, -kDepth, 0}, twice, state);
    const double x = 3.0 * kDepth;
    EXPECT_NEAR(x - tick({x, -kDepth, 0}, twice, state).x, kRough.mu_dynamic * kDepth, 1e-12)
        << "two coincident planes carry the load of one";
}

TEST(FrictionState, RespectsAPlaneThatDoesNotHoldTheProxyYet) {
    // The particle sticks to the floor beside a wall, and the wall approaches.
    Planes planes{{Vec3(0, 1, 0), 0.0}, {Vec3(1, 0, 0), -0.01}};
    FrictionState state;
    (void)tick({0, -kDepth, 0}, planes, state);
    const Vec3 goal(0.001, -kDepth, 0.0);
    planes[1].offset = 0.0005;
    EXPECT_NEAR(tick(goal, planes, state).x, 0.0005, 1e-12);
}

TEST(FrictionState, StaysInTheConeAndThePlanesForRandomInput) {
    test::Random random(5);
    FrictionState state;
    for (int k = 0; k < 20000; ++k) {
        Planes planes;
        for (int i = 0; i < 1 + k % 3; ++i) {
            planes.push_back({random.direction(), random.uniform(-0.01, 0.01)});
        }
        const Vec3 goal(random.uniform(-0.02, 0.02), random.uniform(-0.02, 0.02), random.uniform(-0.02, 0.02));
        const LocalProxy proxy = project(goal, planes);
        const Vec3 surface_displacement = 1e-4 * random.direction();
        const Vec3 offset = apply_friction(proxy, goal, planes, kRough, surface_displacement, state);
        const double push = glm::length(proxy.position - goal);
        // With opposing normals the sum of the normal loads is unbounded; with one plane it is the resultant.
        if (planes.size() == 1) {
            ASSERT_LE(glm::length(offset), kRough.mu_static * push * (1.0 + 1e-9)) << k;
            ASSERT_NEAR(glm::dot(offset, planes[0].normal), 0.0, 1e-12) << k;
        }
        if (proxy.feasible) {
            for (const HalfSpace& plane : planes) {
                ASSERT_GE(glm::dot(plane.normal, proxy.position + offset), plane.offset - 1e-9) << k;
            }
        }
    }
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const LocalProxy proxy = project({0, -kDepth, 0}, floor_plane());
    state = {};
    (void)tick({0, -kDepth, 0}, floor_plane(), state);
    EXPECT_EQ(apply_friction(proxy, {0, -kDepth, 0}, floor_plane(), kRough, Vec3(nan), state), Vec3(0.0));
    EXPECT_FALSE(state.in_contact);
}

}  // namespace
}  // namespace haptic::rt
