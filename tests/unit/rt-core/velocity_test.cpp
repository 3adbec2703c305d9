#include "haptic/rt/velocity.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

namespace haptic::rt {
namespace {

constexpr std::int64_t kTickNs = 1'000'000;

Quat turn(const Vec3& axis, double angle_rad) {
    return glm::angleAxis(angle_rad, glm::normalize(axis));
}

TEST(RotationBetween, IsTheAxisTimesTheAngle) {
    const Quat from = turn({1, 2, 3}, 0.7);
    for (const double angle : {0.0, 1e-12, 1e-6, 0.1, 1.0, 3.0}) {
        const Vec3 axis = glm::normalize(Vec3(0.3, -1.0, 0.2));
        const Vec3 found = rotation_between(from, turn(axis, angle) * from);
        EXPECT_LT(glm::length(found - angle * axis), 1e-9) << angle;
    }
}

TEST(RotationBetween, TakesTheShorterWayWhateverTheSignOfTheQuaternion) {
    const Quat to = turn({0, 1, 0}, 0.2);
    EXPECT_LT(glm::length(rotation_between(Quat(1, 0, 0, 0), -to) - Vec3(0, 0.2, 0)), 1e-12);
    const Vec3 back = rotation_between(Quat(1, 0, 0, 0), turn({0, 1, 0}, 2.0 * std::numbers::pi - 0.2));
    EXPECT_LT(glm::length(back - Vec3(0, -0.2, 0)), 1e-12);
}

TEST(VelocityFilter, ConvergesToASteadyTwist) {
    VelocityFilter filter(0.004);
    const Vec3 v(0.1, -0.2, 0.05);
    const Vec3 w(0.0, 2.0, 0.0);
    for (int tick = 0; tick <= 100; ++tick) {
        const double t = 1e-3 * tick;
        filter.update({t * v, turn(w, t * glm::length(w))}, kTickNs);
    }
    // 100 ms are 25 time constants: e^-20 of the step is left.
    EXPECT_LT(glm::length(filter.twist().linear - v), 1e-8);
    EXPECT_LT(glm::length(filter.twist().angular - w), 1e-8);
}

TEST(VelocityFilter, ReachesAboutTwoThirdsOfAStepAfterItsTimeConstant) {
    VelocityFilter filter(0.02);
    for (int tick = 1; tick <= 20; ++tick) {
        filter.update({Vec3(1e-3 * tick, 0, 0), Quat(1, 0, 0, 0)}, kTickNs);
    }
    EXPECT_NEAR(filter.twist().linear.x, 1.0 - std::exp(-1.0), 0.02);
}

TEST(VelocityFilter, WithoutATimeConstantIsTheDifferenceQuotient) {
    VelocityFilter filter(0.0);
    filter.reset({Vec3(1, 0, 0), Quat(1, 0, 0, 0)});
    EXPECT_NEAR(filter.update({Vec3(1.002, 0, 0), Quat(1, 0, 0, 0)}, 2 * kTickNs).linear.x, 1.0, 1e-9);
}

TEST(VelocityFilter, KeepsItsVelocityWhereNoTimeHasPassed) {
    VelocityFilter filter(0.0);
    filter.update({Vec3(0.001, 0, 0), Quat(1, 0, 0, 0)}, kTickNs);
    const Vec3 before = filter.twist().linear;
    EXPECT_EQ(filter.update({Vec3(5, 0, 0), Quat(1, 0, 0, 0)}, 0).linear, before);
}

}  // namespace
}  // namespace haptic::rt
