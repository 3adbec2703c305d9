#include "tick/force_budget.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "units.hpp"

namespace haptic::rt {
namespace {

using test::kTick;

TEST(ForceBudget, KnowsNoLimitByDefault) {
    ForceBudget budget{BudgetLimits{}};
    for (int k = 0; k < 10'000; ++k) {
        budget.update(1.0, kTick, true);
    }
    EXPECT_FALSE(budget.warns());
    EXPECT_NEAR(budget.given(), 10'000.0, 1e-6);
}

TEST(ForceBudget, IsSpentByAPowerThatLastsWithAWarningBefore) {
    // 3 W against 1.5 J: E(t) = 3 (1 - exp(-t)), which reaches 1.2 J after 0.511 s and 1.5 J after 0.693 s.
    ForceBudget budget({.second = 1.5});
    double warned_s = 0.0;
    double t = 0.0;
    for (; !budget.spent(); t += kTick) {
        budget.update(3.0 * kTick, kTick, true);
        warned_s = budget.warns() && warned_s == 0.0 ? t : warned_s;
    }
    EXPECT_NEAR(warned_s, std::log(3.0 / 1.8), 0.003);
    EXPECT_NEAR(t, std::log(2.0), 0.003);
}

TEST(ForceBudget, IsNotSpentByASpringThatGivesBackWhatItTook) {
    // 5 J in, 5 J out, for an hour: the second's energy never exceeds what the spring holds.
    ForceBudget budget({.second = 0.5});
    for (int k = 0; k < 3'600'000; ++k) {
        budget.update((k % 200 < 100 ? -1.0 : 1.0) * 4e-3, kTick, true);
    }
    EXPECT_FALSE(budget.spent());
    EXPECT_LT(budget.peak_second(), 0.5);
}

TEST(ForceBudget, IsSpentByAllThatTheSessionGave) {
    ForceBudget budget({.session = 10.0});
    double given = 0.0;
    while (!budget.spent()) {
        budget.update(2e-3, kTick, true);
        budget.update(-5e-3, kTick, true);  // what the hand gives does not refill it
        given += 2e-3;
    }
    EXPECT_NEAR(given, 10.0, 0.01);
}

TEST(ForceBudget, CountsTheTimeOfRenderingOnly) {
    ForceBudget budget({.duration = 2.0});
    for (int k = 0; k < 5000; ++k) {
        budget.update(0.0, kTick, false);
    }
    EXPECT_EQ(budget.used(), 0.0);
    for (int k = 0; k < 1999; ++k) {
        budget.update(0.0, kTick, true);
    }
    EXPECT_TRUE(budget.warns());
    EXPECT_FALSE(budget.spent());
    budget.update(0.0, 2.0 * kTick, true);
    EXPECT_TRUE(budget.spent());
}

}  // namespace
}  // namespace haptic::rt
