#include "haptic/clock.hpp"

#include <gtest/gtest.h>

#include <chrono>

namespace haptic {
namespace {

TEST(Clock, CountsNanosecondsOfTheMonotonicClock) {
    // libstdc++'s steady_clock is CLOCK_MONOTONIC: its reading lies between ours before and after.
    const std::int64_t before = monotonic_now_ns();
    const std::int64_t between = std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
    const std::int64_t after = monotonic_now_ns();
    EXPECT_LE(before, between);
    EXPECT_LE(between, after);
}

}  // namespace
}  // namespace haptic
