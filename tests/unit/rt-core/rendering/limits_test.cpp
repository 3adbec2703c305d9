#include "rendering/limits.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <random>

#include "units.hpp"

namespace haptic::rt {
namespace {

using test::kTickNs;

const WrenchLimits kLimits{8.0, 0.15, 1000.0, 20.0};
constexpr double kRounding = 1e-12;

TEST(WrenchLimiter, LeavesAWrenchWithinItsLimitsUnchanged) {
    WrenchLimiter limiter(kLimits);
    const Wrench small{{0.3, -0.2, 0.1}, {0.001, 0.002, -0.003}};
    const WrenchLimiter::Result result = limiter.apply(small, kTickNs);
    EXPECT_EQ(result.wrench.force, small.force);
    EXPECT_EQ(result.wrench.torque, small.torque);
    EXPECT_FALSE(result.size_limited);
    EXPECT_FALSE(result.rate_limited);
}

TEST(WrenchLimiter, ShortensALargeForceAndKeepsItsDirection) {
    WrenchLimiter limiter(kLimits);
    const Vec3 direction = glm::normalize(Vec3(1, 2, -3));
    WrenchLimiter::Result result;
    for (int tick = 0; tick < 20; ++tick) {
        result = limiter.apply({50.0 * direction, {}}, kTickNs);
        EXPECT_TRUE(result.size_limited);
    }
    EXPECT_LT(glm::length(result.wrench.force - 8.0 * direction), 1e-9);
}

TEST(WrenchLimiter, NeverExceedsSizeOrRateForRandomWrenches) {
    WrenchLimiter limiter(kLimits);
    std::mt19937_64 random(7);
    std::normal_distribution<double> force(0.0, 10.0);
    std::normal_distribution<double> torque(0.0, 0.2);
    Wrench last;
    for (int tick = 0; tick < 20'000; ++tick) {
        const Wrench wanted{{force(random), force(random), force(random)},
                            {torque(random), torque(random), torque(random)}};
        const Wrench got = limiter.apply(wanted, kTickNs).wrench;
        ASSERT_LE(glm::length(got.force), kLimits.force + kRounding);
        ASSERT_LE(glm::length(got.torque), kLimits.torque + kRounding);
        ASSERT_LE(glm::length(got.force - last.force), kLimits.force_rate * 1e-3 + kRounding);
        ASSERT_LE(glm::length(got.torque - last.torque), kLimits.torque_rate * 1e-3 + kRounding);
        last = got;
    }
}

TEST(WrenchLimiter, TreatsANonFiniteWrenchAsZero) {
    WrenchLimiter limiter(kLimits);
    limiter.apply({{0.5, 0, 0}, {}}, kTickNs);
    for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
        const Wrench got = limiter.apply({{0, bad, 0}, {bad, 0, 0}}, kTickNs).wrench;
        EXPECT_EQ(got.force, Vec3(0.0));
        EXPECT_EQ(got.torque, Vec3(0.0));
    }
}

TEST(WrenchLimiter, IsFiniteForAForceWhoseSquareOverflows) {
    WrenchLimiter limiter(kLimits);
    const Wrench got = limiter.apply({{1e300, 1e300, 0}, {}}, kTickNs).wrench;
    EXPECT_TRUE(std::isfinite(got.force.x));
    EXPECT_LE(glm::length(got.force), kLimits.force);
}

}  // namespace
}  // namespace haptic::rt
