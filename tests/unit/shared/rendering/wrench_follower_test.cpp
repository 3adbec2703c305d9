#include "rendering/wrench_follower.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "random.hpp"

namespace haptic::rt {
namespace {

constexpr double kTick = 1e-3;  // s
constexpr double kRelease = 0.05;

WantedWrench wanted(const Vec3& force, double travel = 0.0, bool in_contact = true) {
    return {.wrench = {force, Vec3(0.0)}, .force_of_motion = travel, .in_contact = in_contact};
}

TEST(WrenchFollower, RespectsItsBoundAndApproachesAnyWantedWrench) {
    test::Random random(5);
    WrenchFollower follower(kRelease);
    Wrench felt = follower.follow(wanted(Vec3(1.0, 0.0, 0.0)), kTick);
    for (int i = 0; i < 20000; ++i) {
        WantedWrench next;
        next.wrench.force = random.normal();
        next.wrench.torque = 0.05 * random.normal();
        next.force_of_motion = random.uniform(0.0, 0.5);
        next.announced = {random.uniform(0.0, 0.5) * random.direction(),
                          random.uniform(0.0, 0.025) * random.direction()};
        next.max_force_of_motion = random.uniform(0.0, 0.7);
        next.force_of_stiffness = random.uniform(0.0, 1.0) < 0.1 ? 0.2 : 0.0;
        next.torque_of_stiffness = random.uniform(0.0, 1.0) < 0.1 ? 0.015 : 0.0;
        next.max_moment_arm = 0.05;
        next.in_contact = true;
        const Wrench now = follower.follow(next, kTick);
        const double announced = std::min(glm::length(next.announced.force), next.max_force_of_motion);
        const double motion = std::max(next.force_of_motion, announced);
        const double announced_torque = std::min(glm::length(next.announced.torque), 0.05 * next.max_force_of_motion);
        const double torque_motion = std::max(0.05 * next.force_of_motion, announced_torque);
        const double bound = 1.5 * motion + next.force_of_stiffness + 1e-3;
        const double torque_bound = 1.5 * torque_motion + next.torque_of_stiffness + 0.05 * 1e-3;
        ASSERT_LE(glm::length(now.force - felt.force), bound * (1.0 + 1e-12));
        ASSERT_LE(glm::length(now.torque - felt.torque), torque_bound * (1.0 + 1e-12));
        // Along the straight line, by as much as the tighter of the two bounds allows.
        const Vec3 way = next.wrench.force - felt.force;
        const double share = glm::dot(now.force - felt.force, way) / glm::dot(way, way);
        ASSERT_LT(glm::length(now.force - felt.force - share * way), 1e-12);
        const double possible =
            std::min({1.0, bound / glm::length(way), torque_bound / glm::length(next.wrench.torque - felt.torque)});
        ASSERT_NEAR(share, possible, 1e-9);
        felt = now;
    }
}

TEST(WrenchFollower, EqualsTheWantedWrenchBitForBitWhereTheBoundAllows) {
    WrenchFollower follower(kRelease);
    (void)follower.follow(wanted({0.1, 0.2, 0.3}), kTick);
    const Vec3 next(0.1 + 1e-4, 0.2 - 3e-4, 0.3 + 1.0 / 3.0 * 1e-4);
    EXPECT_EQ(follower.follow(wanted(next), kTick).force, next);
}

TEST(WrenchFollower, ReachesExactlyZeroWithinTheReleaseTimeAfterContact) {
    WrenchFollower follower(kRelease);
    (void)follower.follow(wanted({3.0, -4.0, 0.0}), kTick);
    double before = 5.0;
    for (int i = 0; i < 51; ++i) {
        const double now = glm::length(follower.follow(wanted(Vec3(0.0), 0.0, false), kTick).force);
        EXPECT_LE(before - now, 5.0 * kTick / kRelease + 1e-12);
        before = now;
    }
    EXPECT_EQ(before, 0.0);
}

TEST(WrenchFollower, TakesTheNextWrenchAtOnceAfterARestart) {
    WrenchFollower follower(kRelease);
    (void)follower.follow(wanted({1.0, 0.0, 0.0}), kTick);
    follower.restart();
    EXPECT_EQ(follower.follow(wanted({9.0, 0.0, 0.0}), kTick).force.x, 9.0);
    EXPECT_NEAR(follower.follow(wanted({1.0, 0.0, 0.0}), kTick).force.x, 9.0 - 1e-3, 1e-12);
}

TEST(WrenchFollower, PassesANonFiniteWrenchOnAndForgetsIt) {
    WrenchFollower follower(kRelease);
    (void)follower.follow(wanted({1.0, 0.0, 0.0}), kTick);
    const double infinite = std::numeric_limits<double>::infinity();
    EXPECT_FALSE(std::isfinite(follower.follow(wanted({infinite, 0.0, 0.0}), kTick).force.x));
    EXPECT_NEAR(follower.follow(wanted({1.0, 0.0, 0.0}), kTick).force.x, 1e-3, 1e-12);
}

}  // namespace
}  // namespace haptic::rt
