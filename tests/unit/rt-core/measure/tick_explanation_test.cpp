#include "measure/tick_explanation.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>

namespace haptic::rt {
namespace {

using testing::HasSubstr;

/// A typical tick: 5 us late, 10 us long.
TimedTick usual_tick() {
    TimedTick tick;
    tick.number = 7;
    tick.deadline_ns = 1'000'000;
    tick.now_ns = 1'005'000;
    tick.compute_ns = 10'000;
    tick.timing.stages_ns = {3000, 2000, 1000, 2000, 1000, 1000};
    tick.usage.voluntary_switches = 1;
    tick.waited_ns = 1000;
    tick.exchange_in = 0;
    tick.exchange_out = 0;
    return tick;
}

MedianTimes usual() {
    return {{5000, 3000, 2000, 1000, 2000, 1000, 0}};
}

/// A typical tick with additional time in one stage.
TimedTick longer(TickStage stage, std::int64_t by_ns) {
    TimedTick tick = usual_tick();
    tick.timing.of(stage) += by_ns;
    tick.compute_ns += by_ns;
    return tick;
}

TEST(TickExplanation, FindsNothingToExplainInATypicalTick) {
    EXPECT_EQ(explain(usual_tick(), usual(), 0).cause, LateCause::Usual);
}

TEST(TickExplanation, NamesTheStageWithTheLargestExcess) {
    for (std::size_t i = 0; i < kTickStages; ++i) {
        TimedTick tick = longer(static_cast<TickStage>(i), 300'000);
        tick.now_ns += 100'000;  // late as well, but by less
        const TickExplanation explained = explain(tick, usual(), 0);
        EXPECT_EQ(static_cast<std::size_t>(explained.stage), i + 1);
        EXPECT_NEAR(static_cast<double>(explained.excess_ns), 300'000.0, 2000.0);
        EXPECT_EQ(explain(tick, usual(), 0, Explain::Wakeup).stage, LateStage::Wakeup);
    }
}

TEST(TickExplanation, DistinguishesRunQueueWaitFromALateTimer) {
    TimedTick tick = usual_tick();
    tick.now_ns += 400'000;
    tick.waited_ns = 390'000;
    EXPECT_EQ(explain(tick, usual(), 0).cause, LateCause::Queued);
    EXPECT_THAT(explain(tick, usual(), 0).why, HasSubstr("waited 390 us"));
    tick.waited_ns = 2000;
    EXPECT_EQ(explain(tick, usual(), 0).cause, LateCause::Timer);
    EXPECT_EQ(explain(tick, usual(), 10).cause, LateCause::Stolen);
    tick.waited_ns = -1;
    EXPECT_EQ(explain(tick, usual(), -1).cause, LateCause::Timer);
    EXPECT_THAT(explain(tick, usual(), -1).why, HasSubstr("this kernel does not report"));
}

TEST(TickExplanation, BlamesAPageFaultBeforeThePreemptionThatItCauses) {
    TimedTick tick = longer(TickStage::Proxy, 200'000);
    tick.usage.page_faults = 2;
    tick.usage.forced_switches = 1;
    EXPECT_EQ(explain(tick, usual(), 0).cause, LateCause::PageFault);
    EXPECT_THAT(explain(tick, usual(), 0).why, HasSubstr("2 page faults"));
    tick.usage.page_faults = 0;
    tick.waited_ns = 180'000;
    EXPECT_EQ(explain(tick, usual(), 0).cause, LateCause::Preempted);
    EXPECT_THAT(explain(tick, usual(), 0).why, HasSubstr("preempted 1 time, and without its processor for 180 us"));
    tick.waited_ns = 9000;
    EXPECT_EQ(explain(tick, usual(), 0).cause, LateCause::Unseen) << "it was back long before it had lost 200 us";
    tick.waited_ns = -1;
    EXPECT_EQ(explain(tick, usual(), 0).cause, LateCause::Preempted) << "for how long is not known";
}

TEST(TickExplanation, AttributesFailedAndSlowExchangesToTheBoard) {
    TimedTick tick = longer(TickStage::Exchange, 2'000'000);
    tick.usage.voluntary_switches = 3;
    EXPECT_EQ(explain(tick, usual(), 0).cause, LateCause::Board);
    tick.exchange_in = static_cast<std::int8_t>(device::ExchangeStatus::Timeout);
    EXPECT_EQ(explain(tick, usual(), 0).cause, LateCause::Board);
    EXPECT_THAT(explain(tick, usual(), 0).why, HasSubstr(std::string(describe(device::ExchangeStatus::Timeout))));
    // The answer to the motor command of the tick before, which did not come.
    tick = longer(TickStage::Exchange, 2'000'000);
    tick.usage.page_faults = 1;
    tick.exchange_collected = static_cast<std::int8_t>(device::ExchangeStatus::Timeout);
    EXPECT_EQ(explain(tick, usual(), 0).cause, LateCause::Board);
    tick = longer(TickStage::Pose, 2'000'000);
    tick.usage.voluntary_switches = 3;
    EXPECT_EQ(explain(tick, usual(), 0).cause, LateCause::Unseen) << "no board keeps a pose waiting";
}

TEST(TickExplanation, ComparesWithTheMediansOfTheRun) {
    const auto instruments = std::make_unique<Instruments>();
    for (int i = 0; i < 9; ++i) {
        instruments->wakeup.record(100);
        instruments->proxy.record(70);
    }
    instruments->wakeup.record(1'000'000);
    EXPECT_EQ(median_times(*instruments).stages_ns[0], 100);
    EXPECT_EQ(median_times(*instruments).stages_ns[static_cast<std::size_t>(LateStage::Proxy)], 70);
}

}  // namespace
}  // namespace haptic::rt
