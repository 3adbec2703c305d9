#include "scene/hostile_hand.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <vector>

namespace haptic::sim {
namespace {

constexpr double kHandStep = 0.01;
const std::vector<Vec3> kTargets{{0.0, 0.0, 0.0}, {0.3, 0.1, -0.2}, {-0.2, 0.0, 0.4}};

TEST(HostileHand, NeverExceedsItsSpeed) {
    HostileHand hand(3, 5.0, 15.0, Vec3(1.0));
    Vec3 last(1.0);
    double fastest = 0.0;
    for (int k = 0; k < 20'000; ++k) {
        const Vec3 now = hand.advance(kHandStep, kTargets);
        fastest = std::max(fastest, glm::length(now - last) / kHandStep);
        last = now;
    }
    EXPECT_LE(fastest, 5.0 * (1.0 + 1e-12));
    EXPECT_GT(fastest, 4.5);
}

TEST(HostileHand, NeverExceedsItsTurnRateAndReachesAllOrientations) {
    HostileHand hand(3, 5.0, 15.0, Vec3(1.0));
    Quat last = hand.orientation();
    double fastest = 0.0;
    int upside_down = 0;
    for (int k = 0; k < 20'000; ++k) {
        (void)hand.advance(kHandStep, kTargets);
        const Quat now = hand.orientation();
        ASSERT_NEAR(glm::length(now), 1.0, 1e-12);
        // cosine of half the angle between the two; rounding hides angles below 1e-8 rad
        const double angle = 2.0 * std::acos(std::min(1.0, std::abs(glm::dot(now, last))));
        fastest = std::max(fastest, angle / kHandStep);
        upside_down += (now * Vec3(0.0, 1.0, 0.0)).y < 0.0 ? 1 : 0;
        last = now;
    }
    EXPECT_LE(fastest, 15.0 * (1.0 + 1e-6));
    EXPECT_GT(fastest, 13.0);
    EXPECT_GT(upside_down, 5'000);  // half of all orientations, if uniform
    EXPECT_LT(upside_down, 15'000);
}

TEST(HostileHand, PathDoesNotDependOnItsRotation) {
    HostileHand turning(5, 5.0, 15.0, Vec3(0.0));
    HostileHand straight(5, 5.0, 0.0, Vec3(0.0));
    for (int k = 0; k < 1'000; ++k) {
        EXPECT_EQ(turning.advance(kHandStep, kTargets), straight.advance(kHandStep, kTargets));
        EXPECT_EQ(straight.orientation(), Quat(1.0, 0.0, 0.0, 0.0));
    }
}

TEST(HostileHand, OpensAndClosesWithinItsSpeed) {
    HostileHand hand(3, 5.0, 15.0, Vec3(1.0));
    double last = hand.curl();
    double fastest = 0.0;
    double minimum = 1.0;
    double maximum = 0.0;
    for (int k = 0; k < 20'000; ++k) {
        (void)hand.advance(kHandStep, kTargets);
        fastest = std::max(fastest, std::abs(hand.curl() - last) / kHandStep);
        last = hand.curl();
        minimum = std::min(minimum, last);
        maximum = std::max(maximum, last);
    }
    EXPECT_GE(minimum, 0.0);
    EXPECT_LE(maximum, 1.0);
    EXPECT_LT(minimum, 0.05);
    EXPECT_GT(maximum, 0.95);
    EXPECT_GT(fastest, 5.0);
    EXPECT_LE(fastest, 10.0 * (1.0 + 1e-9));
}

TEST(HostileHand, OvershootsItsTargetsAndAlwaysReturns) {
    HostileHand hand(1, 5.0, 15.0, Vec3(0.5));
    int passages = 0;
    double side = 1.0;
    for (int k = 0; k < 60'000; ++k) {  // 10 minutes
        const Vec3 now = hand.advance(kHandStep, kTargets);
        ASSERT_LT(glm::length(now), 10.0);
        if (now.y * side < 0.0) {
            side = now.y;
            ++passages;
        }
    }
    EXPECT_GT(passages, 100);
}

TEST(HostileHand, IsDeterminedByItsSeed) {
    HostileHand one(7, 5.0, 15.0, Vec3(0.0));
    HostileHand two(7, 5.0, 15.0, Vec3(0.0));
    HostileHand other(8, 5.0, 15.0, Vec3(0.0));
    bool differs = false;
    for (int k = 0; k < 1'000; ++k) {
        const Vec3 position = one.advance(kHandStep, kTargets);
        EXPECT_EQ(position, two.advance(kHandStep, kTargets));
        EXPECT_EQ(one.orientation(), two.orientation());
        differs = differs || position != other.advance(kHandStep, kTargets);
    }
    EXPECT_TRUE(differs);
}

TEST(HostileHand, StaysInPlaceWithoutTargets) {
    HostileHand hand(1, 5.0, 15.0, Vec3(0.25));
    for (int k = 0; k < 1'000; ++k) {
        EXPECT_EQ(hand.advance(kHandStep, {}), Vec3(0.25));
    }
}

}  // namespace
}  // namespace haptic::sim
