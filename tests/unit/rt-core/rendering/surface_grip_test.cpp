#include <haptic/rt/surface_grip.hpp>

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

/// The place of a particle for a goal, after one tick.
Vec3 tick(const Vec3& goal, const Planes& planes, SurfaceGrip& grip, const Vec3& carried = Vec3(0.0),
          const Friction& friction = kRough) {
    const LocalProxy proxy = project(goal, planes);
    return proxy.position + hold(proxy, goal, planes, friction, carried, grip);
}

Planes floor_plane() {
    return {{Vec3(0, 1, 0), 0.0}};
}

TEST(SurfaceGrip, IsNothingWithoutFrictionOrContact) {
    SurfaceGrip grip;
    grip.held = true;
    grip.at = Vec3(1.0);
    const LocalProxy held = project(Vec3(0, -kDepth, 0), floor_plane());
    EXPECT_EQ(hold(held, Vec3(0, -kDepth, 0), floor_plane(), {}, Vec3(0.1), grip), Vec3(0.0));
    EXPECT_FALSE(grip.held);
    grip.held = true;
    const LocalProxy free = project(Vec3(0, kDepth, 0), floor_plane());
    EXPECT_EQ(hold(free, Vec3(0, kDepth, 0), floor_plane(), kRough, Vec3(0.1), grip), Vec3(0.0));
    EXPECT_FALSE(grip.held);
}

TEST(SurfaceGrip, SticksInTheStaticConeAndSlidesOnTheDynamicOneUntilItRests) {
    SurfaceGrip grip;
    const Planes planes = floor_plane();
    const Vec3 way(0.6, 0.0, 0.8);
    const auto under = [&](double x) { return x * way + Vec3(0, -kDepth, 0); };
    const Vec3 landed = tick(under(0.0), planes, grip);
    double x = 0.0;
    while (x < 0.999 * kRough.at_rest * kDepth) {
        ASSERT_LT(glm::length(tick(under(x), planes, grip) - landed), 1e-15);
        x += 1e-4;
    }
    for (x = 1.001 * kRough.at_rest * kDepth; x < 0.02; x += 1e-4) {
        const double behind = x - glm::dot(tick(under(x), planes, grip), way);
        ASSERT_NEAR(behind, kRough.sliding * kDepth, 1e-12);
        ASSERT_TRUE(grip.slides);
    }
    const Vec3 rest = tick(under(x), planes, grip);
    (void)tick(under(x), planes, grip);
    EXPECT_FALSE(grip.slides);
    x += 0.9 * (kRough.at_rest - kRough.sliding) * kDepth;
    EXPECT_LT(glm::length(tick(under(x), planes, grip) - rest), 1e-15) << "it holds up to the static cone again";
}

TEST(SurfaceGrip, GoesWithTheSurfaceUntilTheGoalLeavesTheCone) {
    SurfaceGrip grip;
    const Vec3 goal(0, -kDepth, 0);
    (void)tick(goal, floor_plane(), grip);
    double gone = 0.0;
    for (int k = 0; k < 100; ++k) {
        const Vec3 carried(1e-4, 3e-5, 0.0);  // what is not in the plane does not count
        gone += carried.x;
        const Vec3 at = tick(goal, floor_plane(), grip, carried);
        ASSERT_NEAR(at.y, 0.0, 1e-15);
        if (gone < kRough.at_rest * kDepth - 1e-9) {
            ASSERT_NEAR(at.x, gone, 1e-12);
        } else if (gone > kRough.at_rest * kDepth + 2e-4) {
            ASSERT_NEAR(at.x, kRough.sliding * kDepth, 1e-12);
        }
    }
}

TEST(SurfaceGrip, AddsTheForcesOfBothWallsOfAGroove) {
    const double h = std::sqrt(0.5);
    const Planes groove{{Vec3(h, h, 0), 0.0}, {Vec3(-h, h, 0), 0.0}};
    SurfaceGrip grip;
    (void)tick({0, -kDepth, 0}, groove, grip);
    const double load = std::sqrt(2.0) * kDepth;  // h + h times the depth
    EXPECT_NEAR(tick({0, -kDepth, 0.99 * kRough.at_rest * load}, groove, grip).z, 0.0, 1e-15);
    const double z = 3.0 * load;
    EXPECT_NEAR(z - tick({0, -kDepth, z}, groove, grip).z, kRough.sliding * load, 1e-12);
}

TEST(SurfaceGrip, IsHeldFastInACornerAndByPlanesThatAreAlike) {
    const Planes corner{{Vec3(1, 0, 0), 0.0}, {Vec3(0, 1, 0), 0.0}, {Vec3(0, 0, 1), 0.0}};
    SurfaceGrip grip;
    (void)tick(Vec3(-kDepth), corner, grip);
    EXPECT_LT(glm::length(tick({-kDepth, -2 * kDepth, -3 * kDepth}, corner, grip)), 1e-15);
    const Planes twice{{Vec3(0, 1, 0), 0.0}, {Vec3(0, 1, 0), 0.0}};
    grip = {};
    (void)tick({0, -kDepth, 0}, twice, grip);
    const double x = 3.0 * kDepth;
    EXPECT_NEAR(x - tick({x, -kDepth, 0}, twice, grip).x, kRough.sliding * kDepth, 1e-12)
        << "two of the same hold as much as one";
}

TEST(SurfaceGrip, StaysOutOfAPlaneThatDoesNotHoldTheProxyYet) {
    // It sticks to the floor beside a wall, and the wall comes.
    Planes planes{{Vec3(0, 1, 0), 0.0}, {Vec3(1, 0, 0), -0.01}};
    SurfaceGrip grip;
    (void)tick({0, -kDepth, 0}, planes, grip);
    const Vec3 goal(0.001, -kDepth, 0.0);
    planes[1].offset = 0.0005;
    EXPECT_NEAR(tick(goal, planes, grip).x, 0.0005, 1e-12);
}

TEST(SurfaceGrip, NeverLeavesTheConeNorThePlanesAndAnswersWildNumbers) {
    test::Random random(5);
    SurfaceGrip grip;
    for (int k = 0; k < 20000; ++k) {
        Planes planes;
        for (int i = 0; i < 1 + k % 3; ++i) {
            planes.push_back({random.direction(), random.uniform(-0.01, 0.01)});
        }
        const Vec3 goal(random.uniform(-0.02, 0.02), random.uniform(-0.02, 0.02), random.uniform(-0.02, 0.02));
        const LocalProxy proxy = project(goal, planes);
        const Vec3 carried = 1e-4 * random.direction();
        const Vec3 offset = hold(proxy, goal, planes, kRough, carried, grip);
        const double push = glm::length(proxy.position - goal);
        // With normals that oppose, the sum of the normal forces has no bound but that of the planes; with one it is
        // the resultant.
        if (planes.size() == 1) {
            ASSERT_LE(glm::length(offset), kRough.at_rest * push * (1.0 + 1e-9)) << k;
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
    grip = {};
    (void)tick({0, -kDepth, 0}, floor_plane(), grip);
    EXPECT_EQ(hold(proxy, {0, -kDepth, 0}, floor_plane(), kRough, Vec3(nan), grip), Vec3(0.0));
    EXPECT_FALSE(grip.held);
}

}  // namespace
}  // namespace haptic::rt
