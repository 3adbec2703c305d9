#include "process/timing_log.hpp"

#include <gtest/gtest.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <memory>
#include <random>
#include <vector>

#include "haptic/clock.hpp"

namespace haptic::rt {
namespace {

constexpr std::int64_t kPeriodNs = 1'000'000;

/// The nth tick with a given lateness and duration.
TickRecord tick_of(std::uint64_t number, std::int64_t wakeup_ns, std::int64_t compute_ns) {
    TickRecord record;
    record.number = number;
    record.deadline_ns = static_cast<std::int64_t>(number) * kPeriodNs;
    record.now_ns = record.deadline_ns + wakeup_ns;
    record.period_ns = number == 1 ? 0 : kPeriodNs;
    record.compute_ns = compute_ns;
    return record;
}

TEST(TimingLog, KeepsTheLatestTicksInAnyOrder) {
    std::mt19937 random(1);
    std::uniform_int_distribution<std::int64_t> duration(0, 2'000'000);
    const auto log = std::make_unique<TimingLog>();
    std::vector<std::int64_t> lateness;
    for (std::uint64_t i = 1; i <= 1000; ++i) {
        const TickRecord record = tick_of(i, duration(random), duration(random));
        lateness.push_back(record.now_ns - record.deadline_ns + record.compute_ns);
        log->add(record, {}, 0);
    }
    std::sort(lateness.rbegin(), lateness.rend());
    ASSERT_EQ(log->worst().size(), TimingLog::kWorst);
    for (std::size_t i = 0; i < TimingLog::kWorst; ++i) {
        EXPECT_EQ(log->worst()[i].lateness_ns(), lateness[i]) << i;
    }
}

TEST(TimingLog, KeepsTheTickWithTheMaximumOfEachLatency) {
    const auto log = std::make_unique<TimingLog>();
    TickTiming timing;
    log->add(tick_of(1, 10'000, 20'000), timing, 0);
    timing.state_age_ns = 9'000'000;
    log->add(tick_of(2, 50'000, 7'000), timing, 0);
    timing.state_age_ns = -1;
    timing.motion_to_force_ns = 6'000;
    timing.of(TickStage::Exchange) = 3'000;
    log->add(tick_of(3, 30'000, 8'000), timing, 2);
    EXPECT_EQ(log->largest(Latency::Compute).number, 1U);
    EXPECT_EQ(log->largest(Latency::Wakeup).number, 2U);
    EXPECT_EQ(log->largest(Latency::DeviceToPlane).number, 2U);
    EXPECT_EQ(log->largest(Latency::MotionToForce).number, 3U);
    EXPECT_EQ(log->largest(Latency::Exchange).number, 3U);
    EXPECT_EQ(log->late_ticks(), 1U);
    EXPECT_EQ(log->missed(), 2U);
}

TEST(TimingLog, AttributesTheKernelsThreadCountersToEachTick) {
    const auto log = std::make_unique<TimingLog>();
    log->attach();
    log->begin();
    usleep(1000);
    usleep(1000);
    log->add(tick_of(1, 0, 0), {}, 0);
    EXPECT_GE(log->worst()[0].usage.voluntary_switches, 2);
    usleep(1000);
    log->add(tick_of(2, 1, 0), {}, 0);  // the later tick is listed first
    EXPECT_EQ(log->worst()[0].number, 2U);
    EXPECT_GE(log->worst()[0].usage.voluntary_switches, 1);
    EXPECT_LT(log->worst()[0].usage.voluntary_switches, log->worst()[1].usage.voluntary_switches)
        << "what was counted before the last tick's end is not counted again";
    if (access("/proc/thread-self/schedstat", R_OK) == 0) {
        EXPECT_GE(log->worst()[0].waited_ns, 0);
    } else {
        EXPECT_EQ(log->worst()[0].waited_ns, -1);
    }
}

TEST(TimingLog, PassesEventsOfKeptTicksToAnotherThread) {
    const auto log = std::make_unique<TimingLog>();
    std::int64_t at_ns = 0;
    EXPECT_FALSE(log->take_event(at_ns));
    for (std::uint64_t i = 1; i <= 500; ++i) {
        log->add(tick_of(i, i == 400 ? 90'000 : 20'000, i == 1 ? 9'000 : 1000), {}, 0);
        if (i == 399) {
            while (log->take_event(at_ns)) {
            }
        }
    }
    ASSERT_TRUE(log->take_event(at_ns));
    EXPECT_EQ(at_ns, 400 * kPeriodNs + 90'000);
    EXPECT_FALSE(log->take_event(at_ns)) << "the others are neither later nor longer than those kept before";
}

TEST(TimingLog, KeepsEachTickThatMissesADeadlineUntilItIsFull) {
    const auto log = std::make_unique<TimingLog>();
    const std::size_t late = TimingLog::kLate + 10;
    for (std::uint64_t i = 1; i <= 2 * late; ++i) {
        log->add(tick_of(i, 20'000, 30'000), {}, i % 2 == 0 ? 1 : 0);
    }
    EXPECT_EQ(log->late_ticks(), late);
    ASSERT_EQ(log->late().size(), TimingLog::kLate);
    EXPECT_EQ(log->late().front().number, 2U);
    EXPECT_EQ(log->late().back().number, 2 * TimingLog::kLate);
}

TEST(TimingLog, KeepsTheFirstTickAboveALimit) {
    const auto log = std::make_unique<TimingLog>();
    log->break_above(60'000);
    log->add(tick_of(1, 20'000, 30'000), {}, 0);
    EXPECT_EQ(log->broken(), nullptr);
    log->add(tick_of(2, 20'000, 41'000), {}, 0);
    log->add(tick_of(3, 20'000, 90'000), {}, 0);
    ASSERT_NE(log->broken(), nullptr);
    EXPECT_EQ(log->broken()->number, 2U);
    EXPECT_EQ(log->broken()->lateness_ns(), 61'000);
}

TEST(TimingLog, QueuesTheLatenciesOfEachTickForAnotherThread) {
    const auto log = std::make_unique<TimingLog>();
    TickLatencies tick;
    EXPECT_FALSE(log->take_latencies(tick));
    log->add(tick_of(1, 20'000, 30'000), {}, 0);
    log->add(tick_of(2, 25'000, 31'000), {}, 0);
    ASSERT_TRUE(log->take_latencies(tick));
    EXPECT_EQ(tick.period_ns, 0) << "the first tick has none";
    ASSERT_TRUE(log->take_latencies(tick));
    EXPECT_EQ(tick.now_ns, 2 * kPeriodNs + 25'000);
    EXPECT_EQ(tick.wakeup_ns, 25'000);
    EXPECT_EQ(tick.period_ns, kPeriodNs);
    EXPECT_EQ(tick.compute_ns, 31'000);
    EXPECT_FALSE(log->take_latencies(tick));
    EXPECT_EQ(log->lost_latencies(), 0U);
}

}  // namespace
}  // namespace haptic::rt
