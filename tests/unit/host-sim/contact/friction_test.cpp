// Friction of a tool of one sphere, through whole steps.
#include "contact/friction.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "contact/oracle.hpp"
#include "contact/scenes.hpp"
#include "contact/verification.hpp"
#include "tool/tool_proxies.hpp"

namespace {

using haptic::Mat3;
using haptic::Pose;
using haptic::Quat;
using haptic::Vec3;
using haptic::sim::ContactSettings;
using haptic::sim::find_crossings;
using haptic::sim::FrictionState;
using haptic::sim::one_sphere;
using haptic::sim::ProxyPath;
using haptic::sim::ToolProxies;
using haptic::sim::ToolProxy;
using haptic::sim::oracle::Random;
using haptic::sim::scenes::ball;
using haptic::sim::scenes::Body;
using haptic::sim::scenes::kRadius;
using haptic::sim::scenes::kStep;
using haptic::sim::scenes::placed;
using haptic::sim::scenes::rotation;
using haptic::sim::scenes::sheet;
using haptic::sim::scenes::World;

constexpr double kStatic = 0.8;
constexpr double kDynamic = 0.5;
constexpr double kDepth = 0.02;  // m, of the goal below the lowest position of the proxy

ContactSettings rough(double at_rest = kStatic, double sliding = kDynamic) {
    ContactSettings settings;
    settings.static_friction = at_rest;
    settings.dynamic_friction = sliding;
    return settings;
}

/// A tool of one sphere, in a world.
class Hand {
  public:
    explicit Hand(World& world, const Vec3& at, const ContactSettings& settings = rough())
        : world_(world), tool_(one_sphere(kRadius), settings_of(settings), Pose{at, Quat(1.0, 0.0, 0.0, 0.0)}) {
        tool_.keep_paths(true);
    }

    /// One whole step toward a goal; the bodies have already been moved and refitted.
    const ToolProxy& go(const Vec3& goal) {
        tool_.set_goals(Pose{goal, Quat(1.0, 0.0, 0.0, 0.0)});
        tool_.collect(world_.surfaces);
        EXPECT_TRUE(tool_.find_secure_positions());
        tool_.pop_out();
        tool_.find_equilibrium();
        const ProxyPath& path = tool_.path(0);
        crossings += path.complete() ? find_crossings(world_.motions(), path.knots()).size() : 1;
        return tool_.particles()[0];
    }
    [[nodiscard]] const Vec3& at() const { return tool_.particles()[0].position; }
    [[nodiscard]] const FrictionState& grip() const { return tool_.particles()[0].friction; }

    std::size_t crossings = 0;

  private:
    static ToolProxies::Settings settings_of(const ContactSettings& contact) {
        ToolProxies::Settings settings;
        settings.contact = contact;
        settings.step = kStep;
        settings.springs.stiffness = 100.0;
        return settings;
    }

    World& world_;
    ToolProxies tool_;
};

World floor_of(std::uint32_t cells) {
    World world;
    world.add(sheet(2.0, cells, true));
    world.refit();
    return world;
}

Vec3 over(double x, double z) {
    return {x, kRadius, z};
}
Vec3 under(double x, double z) {
    return {x, kRadius - kDepth, z};
}

TEST(Friction, KeepsAProxyInPlaceWhileTheGoalIsInTheStaticCone) {
    World world = floor_of(20);
    Hand hand(world, over(0.01, 0.02));
    hand.go(under(0.01, 0.02));
    const Vec3 stuck = hand.at();
    for (int k = 0; k < 32; ++k) {
        const double reach = 0.99 * kStatic * kDepth;
        const ToolProxy& m = hand.go(under(0.01 + reach * std::cos(0.2 * k), 0.02 + reach * std::sin(0.2 * k)));
        ASSERT_EQ(m.position, stuck) << k;
        ASSERT_EQ(m.contacts.count, 1u);
        EXPECT_NEAR(glm::length(m.contacts.plane[0].normal - Vec3(0, 1, 0)), 0.0, 1e-12);
        ASSERT_FALSE(hand.grip().slides);
    }
}

TEST(Friction, BreaksAwayAtTheStaticConeAndSlidesOnTheDynamicOneUntilItRests) {
    World world = floor_of(20);
    Hand hand(world, over(0.0, 0.0));
    hand.go(under(0.0, 0.0));
    const Vec3 direction(0.6, 0.0, 0.8);
    double x = 0.0;
    int broke = 0;
    for (int k = 1; k <= 60; ++k) {
        x += 0.001;
        const ToolProxy& m = hand.go(under(x * direction.x, x * direction.z));
        const double behind = x - glm::dot(m.position, direction);
        if (x <= kStatic * kDepth + 1e-9) {
            ASSERT_NEAR(behind, x, 1e-12);
        } else {
            ASSERT_NEAR(behind, kDynamic * kDepth, 0.01 * kDynamic * kDepth) << "constant while it slides";
            ASSERT_TRUE(hand.grip().slides);
            broke += 1;
        }
        ASSERT_NEAR(m.position.y, kRadius, 1e-9);
    }
    EXPECT_GT(broke, 30);
    // At rest it sticks again and holds up to the static cone.
    hand.go(under(x * direction.x, x * direction.z));
    EXPECT_FALSE(hand.grip().slides);
    const Vec3 rest = hand.at();
    const double more = x + 0.9 * (kStatic - kDynamic) * kDepth;
    hand.go(under(more * direction.x, more * direction.z));
    EXPECT_EQ(hand.at(), rest);
}

TEST(Friction, IsTheSameInAllDirectionsAndOnAnyTriangulation) {
    for (const std::uint32_t cells : {1u, 7u, 40u}) {
        World world = floor_of(cells);
        for (int k = 0; k < 16; ++k) {
            const Vec3 direction(std::cos(0.4 * k), 0.0, std::sin(0.4 * k));
            Hand hand(world, over(0.013, 0.027));
            hand.go(under(0.013, 0.027));
            const Vec3 goal = under(0.013, 0.027) + 0.1 * direction;
            const ToolProxy& m = hand.go(goal);
            const Vec3 expected = goal + Vec3(0, kDepth, 0) - kDynamic * kDepth * direction;
            EXPECT_NEAR(glm::length(m.position - expected), 0.0, 1e-8) << cells << " " << k;
        }
    }
}

TEST(Friction, CarriesAStickingProxyWithItsSurface) {
    // 1,000 steps of a tenth of a millimetre, the goal moving along: no drift.
    World world = floor_of(10);
    Body& floor = *world.bodies[0];
    Hand hand(world, over(0.01, 0.02));
    hand.go(under(0.015, 0.02));
    const Vec3 stuck = hand.at();
    Vec3 position(0.0);
    for (int k = 0; k < 1000; ++k) {
        position += Vec3(1e-4, 2e-5 * std::sin(0.1 * k), -5e-5);
        floor.stay();
        floor.end = placed(floor.mesh.vertices, Mat3(1.0), position);
        world.refit();
        hand.go(under(0.015, 0.02) + position);
    }
    EXPECT_NEAR(glm::length(hand.at() - position - stuck), 0.0, 1e-3 * kRadius);
    EXPECT_EQ(hand.crossings, 0u);
}

TEST(Friction, LetsASurfacePullAtARestingHandUntilItSlips) {
    World world = floor_of(10);
    Body& floor = *world.bodies[0];
    Hand hand(world, over(0.0, 0.0));
    const Vec3 goal = under(0.0, 0.0);
    hand.go(goal);
    double max_x = 0.0;
    for (int k = 1; k <= 60; ++k) {
        floor.stay();
        floor.end = placed(floor.mesh.vertices, Mat3(1.0), {1e-3 * k, 0.0, 0.0});
        world.refit();
        const ToolProxy& m = hand.go(goal);
        max_x = std::max(max_x, m.position.x);
        if (k <= 15) {
            ASSERT_NEAR(m.position.x, 1e-3 * k, 1e-6) << "taken along";
        } else if (k > 17) {
            ASSERT_NEAR(m.position.x, kDynamic * kDepth, 0.1 * kDynamic * kDepth) << "the surface slips through";
        }
    }
    EXPECT_LE(max_x, kStatic * kDepth * 1.001);
    EXPECT_NEAR(haptic::sim::carrying_velocity(world.surfaces, hand.grip(), kStep).x, 0.1, 1e-9);
}

TEST(Friction, RollsWithoutSlipOnASurfaceThatTilts) {
    // A sphere that does not rotate has the velocity of the touched point: below the axis by its height.
    World world = floor_of(10);
    Body& floor = *world.bodies[0];
    Hand hand(world, over(0.05, 0.0), rough(5.0, 5.0));
    hand.go(under(0.05, 0.0));
    const double angle = 0.002;
    floor.stay();
    floor.end = placed(floor.mesh.vertices, rotation({0, 0, 1}, angle), Vec3(0.0));
    world.refit();
    const ToolProxy& m = hand.go(under(0.05, 0.0));
    EXPECT_NEAR(m.position.y - kRadius, 0.05 * angle, 1e-5);
    EXPECT_NEAR(m.position.x, 0.05, 0.2 * kRadius * angle)
        << "rotating with the surface would have moved it back by r angle";
}

TEST(Friction, CountsBothWallsOfAGroove) {
    // A groove of 90 degrees along z: the normal forces of its walls add up to sqrt(2) times their resultant.
    World world;
    const Mat3 slope = rotation({0, 0, 1}, M_PI / 4);
    Body& left = world.add(sheet(2.0, 8, true));
    Body& right = world.add(sheet(2.0, 8, true));
    left.start = left.end = placed(left.mesh.vertices, rotation({0, 0, 1}, -M_PI / 4), {-0.7, 0.7, 0});
    right.start = right.end = placed(right.mesh.vertices, slope, {0.7, 0.7, 0});
    world.refit();
    const double bottom = std::sqrt(2.0) * kRadius;
    Hand hand(world, {0.0, bottom + 0.01, 0.0});
    hand.go({0.0, bottom - kDepth, 0.0});
    ASSERT_EQ(hand.grip().active_planes.count, 2u);
    const Vec3 stuck = hand.at();
    const double limit = std::sqrt(2.0) * kDepth;
    hand.go({0.0, bottom - kDepth, 0.98 * kStatic * limit});
    EXPECT_NEAR(glm::length(hand.at() - stuck), 0.0, 1e-9);
    hand.go({0.0, bottom - kDepth, 3.0 * limit});
    EXPECT_NEAR(3.0 * limit - hand.at().z, kDynamic * limit, 0.01 * kDynamic * limit);
}

TEST(Friction, KeepsTheForceInTheConeOnARoundBody) {
    World world;
    world.add(ball(0.3, 24));
    world.refit();
    Random random(71);
    Hand hand(world, {0.0, 0.45, 0.0});
    Vec3 goal(0.0, 0.31, 0.0);
    Vec3 drift(0.0);
    int sliding = 0;
    for (int k = 0; k < 400; ++k) {
        drift = 0.9 * drift + random.in_cube(0.004);
        goal = glm::normalize(goal + drift) * 0.315;
        const ToolProxy& m = hand.go(goal);
        ASSERT_GE(world.clearance(m.position), 0.998 * kRadius);
        if (m.contacts.count == 0) {
            continue;
        }
        // Coulomb's law against an ideal ball: facets of 7.5 degrees tilt the normal by up to half of that.
        const Vec3 n = glm::normalize(m.position);
        const Vec3 force = m.position - goal;
        const double normal = glm::dot(force, n);
        const double along = glm::length(force - n * normal);
        ASSERT_LE(along, (kStatic + 0.15) * normal) << k;
        if (hand.grip().slides) {
            ++sliding;
            ASSERT_NEAR(along / normal, kDynamic, 0.15) << k;
        }
    }
    EXPECT_GT(sliding, 50);
    EXPECT_EQ(hand.crossings, 0u);
}

TEST(Friction, LetsGoWithoutAPull) {
    World world = floor_of(10);
    Hand hand(world, over(0.0, 0.0));
    hand.go(under(0.005, 0.0));
    const Vec3 above = over(0.01, 0.02) + Vec3(0, 1e-5, 0);
    EXPECT_EQ(hand.go(above).position, above);
    EXPECT_EQ(hand.grip().active_planes.count, 0u);
}

TEST(Friction, BeginsWhereTheProxyLands) {
    World world = floor_of(10);
    Hand hand(world, over(0.0, 0.0) + Vec3(0.0, 0.1, 0.0), rough(10.0, 10.0));
    // It comes down at 45 degrees, meets the floor half-way and sticks there.
    const ToolProxy& m = hand.go(over(0.2, 0.0) - Vec3(0.0, 0.1, 0.0));
    EXPECT_NEAR(glm::length(m.position - over(0.1, 0.0)), 0.0, 2e-3 * kRadius);
}

TEST(Friction, NeverTakesAProxyThroughABodyThatTumbles) {
    for (const bool inside : {false, true}) {
        Random random(inside ? 73u : 72u);
        World world;
        Body& body = world.add(haptic::sim::scenes::box({0.3, 0.25, 0.35}));
        Hand hand(world, inside ? Vec3(0.01, 0.02, 0.03) : Vec3(0.01, 0.45, 0.02));
        Vec3 hip = hand.at();
        Mat3 attitude(1.0);
        Vec3 position(0.0);
        int touched = 0;
        for (int k = 0; k < 300; ++k) {
            attitude = rotation(random.direction(), random.uniform(-0.05, 0.05)) * attitude;
            position = position * 0.95 + random.in_cube(0.02);
            body.stay();
            body.end = placed(body.mesh.vertices, attitude, position);
            world.refit();
            hip = hip * 0.93 + random.in_cube(0.1);
            touched += hand.go(hip).contacts.count > 0 ? 1 : 0;
            ASSERT_EQ(hand.crossings, 0u) << k;
            ASSERT_GE(world.clearance(hand.at()), 0.998 * kRadius) << k;
        }
        EXPECT_GT(touched, 30);
    }
}

}  // namespace
