#include "contact/speculative_planes.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "contact/scenes.hpp"

namespace {

using haptic::Mat3;
using haptic::Vec3;
using haptic::sim::SpeculativeQuery;
using haptic::sim::SurfacePlane;
using haptic::sim::SurfacePlanes;
using haptic::sim::scenes::Body;
using haptic::sim::scenes::kRadius;
using haptic::sim::scenes::kUpright;
using haptic::sim::scenes::placed;
using haptic::sim::scenes::sheet;
using haptic::sim::scenes::World;

constexpr double kDt = 0.01;

SpeculativeQuery at(const Vec3& p, double reach) {
    SpeculativeQuery q;
    q.position = p;
    q.radius = kRadius;
    q.reach = reach;
    q.dt = kDt;
    return q;
}

TEST(SpeculativePlanes, AreNoneWhereNothingCanCome) {
    World world;
    world.add(sheet(1.0, 8, true));
    world.refit();
    EXPECT_EQ(haptic::sim::speculative_planes(world.surfaces, {}, at({0, 0.06, 0}, 0.02)).count, 0u);
    EXPECT_EQ(haptic::sim::speculative_planes(world.surfaces, {}, at({0, 0.049, 0}, 0.02)).count, 1u);
}

TEST(SpeculativePlanes, SendOnePlaneForAFlatSheet) {
    World world;
    world.add(sheet(1.0, 32, true));
    world.refit();
    const SurfacePlanes planes = haptic::sim::speculative_planes(world.surfaces, {}, at({0.013, 0.035, 0.02}, 0.02));
    ASSERT_EQ(planes.count, 1u);
    EXPECT_NEAR(glm::length(planes.plane[0].normal - Vec3(0, 1, 0)), 0.0, 1e-9);
    EXPECT_NEAR(planes.plane[0].offset, kRadius, 1e-9);
    EXPECT_EQ(planes.plane[0].velocity, 0.0);
}

TEST(SpeculativePlanes, SendTheFallingClothBeforeItTouchesWithItsVelocity) {
    World world;
    Body& cloth = world.add(sheet(1.0, 32, true));
    cloth.start = placed(cloth.mesh.vertices, kUpright, {0.004, 0.25, 0});
    cloth.end = placed(cloth.mesh.vertices, kUpright, {0.004, 0.11, 0});
    world.refit();
    const SurfacePlanes planes = haptic::sim::speculative_planes(world.surfaces, {}, at({0, 0, 0}, 0.01));
    ASSERT_EQ(planes.count, 1u);
    const SurfacePlane& p = planes.plane[0];
    EXPECT_NEAR(p.normal.y, -1.0, 1e-9);
    EXPECT_NEAR(p.velocity, 14.0, 1e-9);
    // dot(normal, x) >= offset + velocity * t reaches the resting centre when the cloth reaches the sphere.
    const double touch = (glm::dot(p.normal, Vec3(0.0)) - p.offset) / p.velocity;
    EXPECT_NEAR(touch, (0.11 - kRadius) / 14.0, 1e-9);
}

TEST(SpeculativePlanes, MeetARimThatComesEdgeOnOnItsEdge) {
    World world;
    Body& cloth = world.add(sheet(0.5, 8, true));
    cloth.start = placed(cloth.mesh.vertices, kUpright, {-0.25 - 0.2, 0.0, 0.011});
    cloth.end = placed(cloth.mesh.vertices, kUpright, {-0.25 - 0.1, 0.0, 0.011});
    world.refit();
    const SurfacePlanes planes = haptic::sim::speculative_planes(world.surfaces, {}, at({0, 0.01, 0}, 0.005));
    ASSERT_GE(planes.count, 1u);
    EXPECT_EQ(planes.plane[0].touched.feature, haptic::sim::Feature::Edge);
    EXPECT_GT(planes.plane[0].normal.x, 0.8);
    EXPECT_GT(planes.plane[0].normal.y, 0.1);
    EXPECT_NEAR(planes.plane[0].velocity, 10.0 * planes.plane[0].normal.x, 1e-9);
}

TEST(SpeculativePlanes, KeepTheContactsFirstAndAddWhatElseIsNear) {
    World world;
    world.add(haptic::sim::scenes::box({0.5, 0.5, 0.5}));
    world.refit();
    const auto moved = haptic::sim::move_proxy(world.surfaces, {0.1, 0.1, 0.1}, {0.46, 0.9, 0.465}, kRadius, kDt, {});
    ASSERT_EQ(moved.contacts.count, 1u);
    const SurfacePlanes planes =
        haptic::sim::speculative_planes(world.surfaces, moved.contacts, at(moved.position, 0.02));
    ASSERT_EQ(planes.count, 3u);
    EXPECT_NEAR(glm::length(planes.plane[0].normal - Vec3(0, -1, 0)), 0.0, 1e-9);
    EXPECT_NEAR(glm::length(planes.plane[1].normal - Vec3(0, 0, -1)), 0.0, 1e-9) << "5 mm off";
    EXPECT_NEAR(glm::length(planes.plane[2].normal - Vec3(-1, 0, 0)), 0.0, 1e-9) << "10 mm off";
}

TEST(SpeculativePlanes, DoNotForbidWhatIsFurtherOffThanTheReach) {
    // Beside the border of a sheet: the plane may forbid only what is within radius + reach of the sheet.
    World world;
    world.add(sheet(0.5, 8, true));
    world.refit();
    for (int k = 0; k < 50; ++k) {
        const Vec3 p(0.25 + 0.03 + 0.0005 * k, 0.001 * (k % 7), 0.0);
        const SurfacePlanes planes = haptic::sim::speculative_planes(world.surfaces, {}, at(p, 0.015));
        for (std::uint32_t n = 0; n < planes.count; ++n) {
            EXPECT_LE(world.clearance(p), kRadius + 0.015 + 1e-9);
            EXPECT_GE(glm::dot(planes.plane[n].normal, p), planes.plane[n].offset - 1e-3 * kRadius)
                << "the proxy itself is allowed";
        }
    }
}

}  // namespace
