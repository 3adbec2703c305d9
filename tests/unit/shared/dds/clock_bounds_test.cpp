#include "dds/clock_bounds.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <random>

namespace haptic {
namespace {

constexpr std::int64_t kOffset = -7'000'000'000'123;

/// An exchange at `now` with these ways, ns, of clocks whose offset is kOffset and that drift by `drift`.
ClockExchange exchange(std::int64_t now_ns, std::int64_t there_ns, std::int64_t back_ns, double drift = 0.0,
                       std::int64_t offset_ns = kOffset) {
    const auto there = [&](std::int64_t here_ns) {
        return here_ns + offset_ns + static_cast<std::int64_t>(drift * static_cast<double>(here_ns));
    };
    const std::int64_t answered_ns = now_ns + there_ns + 1'000;
    return {now_ns, there(now_ns + there_ns), there(answered_ns), answered_ns + back_ns};
}

TEST(ClockBounds, AreUnknownBeforeTheFirstExchange) {
    const ClockBounds clock;
    EXPECT_FALSE(clock.at(0).has_value());
    EXPECT_FALSE(clock.drift().has_value());
}

TEST(ClockBounds, HoldTheOffsetForAnyDelaysInEitherDirection) {
    std::mt19937_64 random(3);
    std::exponential_distribution<double> delay(1.0 / 200e3);
    for (const double drift : {-90e-6, -20e-6, 0.0, 35e-6, 90e-6}) {
        ClockBounds clock;
        for (std::int64_t now = 1'000'000'000; now < 61'000'000'000; now += 100'000'000) {
            // One way is ten times as slow as the other: no average would be right.
            const auto out = static_cast<std::int64_t>(50e3 + 10.0 * delay(random));
            const auto back = static_cast<std::int64_t>(50e3 + delay(random));
            ASSERT_TRUE(clock.add(exchange(now, out, back, drift)));
            const std::int64_t later = now + 50'000'000;
            const std::optional<ClockOffset> offset = clock.at(later);
            ASSERT_TRUE(offset.has_value());
            const auto truth = kOffset + static_cast<std::int64_t>(drift * static_cast<double>(later));
            ASSERT_LE(std::abs(offset->offset_ns - truth), offset->uncertainty_ns + 1) << drift;
        }
        EXPECT_EQ(clock.restarts(), 0u);
        // The bounds are about as narrow as the fastest exchanges.
        EXPECT_LT(clock.at(61'000'000'000)->uncertainty_ns, 250'000);
        EXPECT_NEAR(clock.drift().value(), drift, 15e-6);
    }
}

TEST(ClockBounds, GrowWithTimeWithoutExchanges) {
    ClockBounds clock;
    ASSERT_TRUE(clock.add(exchange(0, 10'000, 10'000)));
    const std::int64_t soon = clock.at(1'000'000)->uncertainty_ns;
    const std::int64_t late = clock.at(10'000'000'000)->uncertainty_ns;
    EXPECT_NEAR(static_cast<double>(late - soon), 1e6, 1e3);  // 100 ppm of 10 s
}

TEST(ClockBounds, RestartWhenAClockWasSet) {
    ClockBounds clock;
    ASSERT_TRUE(clock.add(exchange(0, 10'000, 10'000)));
    ASSERT_TRUE(clock.add(exchange(100'000'000, 10'000, 10'000, 0.0, kOffset + 5'000'000'000)));
    EXPECT_EQ(clock.restarts(), 1u);
    EXPECT_NEAR(static_cast<double>(clock.at(100'000'000)->offset_ns), static_cast<double>(kOffset + 5'000'000'000),
                2e4);
}

TEST(ClockBounds, IgnoreImpossibleTimes) {
    ClockBounds clock;
    EXPECT_FALSE(clock.add({.sent_ns = 100, .received_ns = 0, .replied_ns = 0, .returned_ns = 90}));
    EXPECT_FALSE(clock.add({.sent_ns = 0, .received_ns = 10, .replied_ns = 5, .returned_ns = 100}));
    EXPECT_FALSE(clock.add({.sent_ns = 0, .received_ns = 0, .replied_ns = 500, .returned_ns = 100}));
    EXPECT_FALSE(clock.at(100).has_value());
}

}  // namespace
}  // namespace haptic
