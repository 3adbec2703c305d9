#include "process/stop_input.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <stdexcept>
#include <thread>

#include "tick_rig.hpp"
#include "wait_for.hpp"

namespace haptic::rt {
namespace {

using haptic::test::wait_for;

using testing::HasSubstr;
using testing::ThrowsMessage;

/// A line whose state the test sets.
struct Wire {
    std::atomic<bool> stop{false};
    std::atomic<bool> gone{false};
    std::atomic<int> looks{0};
};

class FakeLine final : public StopLine {
  public:
    explicit FakeLine(Wire& wire) : wire_(&wire) {}
    [[nodiscard]] bool says_stop() override {
        ++wire_->looks;
        if (wire_->gone) {
            throw std::runtime_error("no such device");
        }
        return wire_->stop;
    }

  private:
    Wire* wire_;
};

TEST(StopLineMonitor, CallsStopOnceWhenTheLineIsActive) {
    Wire wire;
    std::atomic<int> stops{0};
    const StopLineMonitor watch(std::make_unique<FakeLine>(wire), [&stops] { ++stops; });
    ASSERT_TRUE(wait_for([&wire] { return wire.looks >= 5; }));
    EXPECT_FALSE(watch.stopped());
    wire.stop = true;
    ASSERT_TRUE(wait_for([&stops] { return stops > 0; }));
    EXPECT_TRUE(watch.stopped());
    const int looks = wire.looks;
    std::this_thread::sleep_for(std::chrono::nanoseconds(4 * StopLineMonitor::kPollNs));
    EXPECT_EQ(wire.looks, looks) << "nothing is left to be watched";
    EXPECT_EQ(stops, 1);
}

TEST(StopLineMonitor, TreatsAnUnreadableLineAsAStop) {
    Wire wire;
    std::atomic<int> stops{0};
    const StopLineMonitor watch(std::make_unique<FakeLine>(wire), [&stops] { ++stops; });
    wire.gone = true;
    ASSERT_TRUE(wait_for([&stops] { return stops > 0; }));
    EXPECT_THAT(watch.reason(), HasSubstr("no such device"));
}

TEST(StopLineMonitor, EndsWithoutAStop) {
    Wire wire;
    std::atomic<int> stops{0};
    {
        const StopLineMonitor watch(std::make_unique<FakeLine>(wire), [&stops] { ++stops; });
    }
    EXPECT_EQ(stops, 0);
}

TEST(GpioStopLine, NamesTheMissingChipAndHowToListThem) {
    EXPECT_THAT([] { (void)open_gpio_stop_line({.chip = "no-such-chip", .line = 3, .stop_when_high = true}); },
                ThrowsMessage<std::runtime_error>(testing::AllOf(
                    HasSubstr("'no-such-chip'"), HasSubstr("safety.stop_chip"), HasSubstr("gpiodetect"))));
}

class StopButton : public testing::TestWithParam<bool> {};

TEST_P(StopButton, OfTheBoardStopsTheLoopInItsOrderlyWay) {
    TickSettings settings;
    settings.stop_button = 1;
    settings.stop_when_released = GetParam();
    const std::uint8_t quiet = settings.stop_when_released ? 0b010 : 0b101;  // other buttons have no effect
    const std::uint8_t stop = settings.stop_when_released ? 0b101 : 0b010;
    test::TickRig rig(PoseTrack(), settings);
    rig.board.device().set_buttons(quiet);
    rig.run_up();
    ASSERT_EQ(rig.tick.safety_state(), SafetyState::Running);
    rig.board.device().set_buttons(stop);
    rig.step();
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Faulted);
    EXPECT_EQ(rig.tick.faults(), static_cast<std::uint32_t>(HAPTIC_FAULT_STOP));
    rig.steps(700);
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Disarmed);
    // While the button is held the motors stay at zero.
    rig.tick.arm();
    rig.step();
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Disarmed);
    EXPECT_EQ(rig.tick.faults(), static_cast<std::uint32_t>(HAPTIC_FAULT_STOP));
    EXPECT_EQ(rig.board.device().dac_codes(), (std::array<std::int16_t, kStrings>{}));
}

INSTANTIATE_TEST_SUITE_P(Each, StopButton, testing::Bool(), [](const testing::TestParamInfo<bool>& param) {
    return std::string(param.param ? "ThatOpens" : "ThatCloses");
});

TEST(StopForGood, HoldsForEveryFurtherArming) {
    test::TickRig rig;
    rig.run_up();
    rig.tick.stop_for_good();
    rig.step();
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Faulted);
    rig.steps(700);
    ASSERT_EQ(rig.tick.safety_state(), SafetyState::Disarmed);
    rig.tick.arm();
    rig.step();
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Disarmed);
    EXPECT_EQ(rig.tick.faults(), static_cast<std::uint32_t>(HAPTIC_FAULT_STOP));
}

TEST(StopButtons, AreNoneByDefault) {
    test::TickRig rig;
    rig.board.device().set_buttons(7);
    rig.run_up();
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Running);
}

}  // namespace
}  // namespace haptic::rt
