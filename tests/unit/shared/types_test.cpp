#include "haptic/types.hpp"

#include <gtest/gtest.h>

namespace haptic {
namespace {

TEST(Types, SecondsBecomeTheNearestNanosecond) {
    EXPECT_EQ(nanoseconds(0.001), 1'000'000);
    EXPECT_EQ(nanoseconds(-0.001), -1'000'000);
    EXPECT_EQ(nanoseconds(0.3e-9), 0);
    EXPECT_EQ(nanoseconds(0.6e-9), 1);
    EXPECT_EQ(nanoseconds(-0.6e-9), -1);
}

TEST(Types, NanosecondsSurviveTheWayThroughSeconds) {
    // Below 2^53 / 1e9 s, about 104 days, a double holds each nanosecond.
    for (const std::int64_t time_ns : {0LL, 1LL, 999'999'999LL, 86'400'000'000'001LL}) {
        EXPECT_EQ(nanoseconds(seconds(time_ns)), time_ns);
    }
}

}  // namespace
}  // namespace haptic
