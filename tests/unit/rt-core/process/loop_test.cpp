#include "process/loop.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mman.h>

#include <atomic>
#include <chrono>
#include <fstream>
#include <string>
#include <thread>

#include "haptic/clock.hpp"
#include "tick_rig.hpp"

namespace haptic::rt {
namespace {

using testing::HasSubstr;

TEST(NextDeadline, IsAPeriodLaterWhenTheTickWasInTime) {
    const NextDeadline next = next_deadline(5000, 1000, 5400);
    EXPECT_EQ(next.deadline_ns, 6000);
    EXPECT_EQ(next.missed, 0);
}

TEST(NextDeadline, KeepsThePhaseAndCountsSkippedDeadlines) {
    for (std::int64_t now = 5000; now < 20'000; now += 37) {
        const NextDeadline next = next_deadline(5000, 1000, now);
        ASSERT_EQ(next.deadline_ns % 1000, 0);
        ASSERT_GT(next.deadline_ns, now);
        ASSERT_LE(next.deadline_ns, now + 1000);
        ASSERT_EQ(next.missed, (next.deadline_ns - 6000) / 1000);
    }
    EXPECT_EQ(next_deadline(5000, 1000, 6000).missed, 1);
    EXPECT_EQ(next_deadline(5000, 1000, 8500).missed, 3);
}

TEST(IsPreemptRt, ReadsTheVersionThatUnameGives) {
    EXPECT_TRUE(is_preempt_rt("6.1.0-26-rt-amd64 #1 SMP PREEMPT_RT Debian 6.1.112-1 (2024-09-30)"));
    EXPECT_FALSE(is_preempt_rt("6.1.0-26-amd64 #1 SMP PREEMPT_DYNAMIC Debian 6.1.112-1 (2024-09-30)"));
}

/// Memory that this process has locked, from the kernel.
long locked_kilobytes() {
    std::ifstream status("/proc/self/status");
    std::string key;
    while (status >> key) {
        if (key == "VmLck:") {
            long kilobytes = 0;
            status >> kilobytes;
            return kilobytes;
        }
    }
    return 0;
}

/// Board whose buttons and cable another thread handles.
class HandledBoard final : public device::Board {
  public:
    explicit HandledBoard(device::Board& board) : board_(&board) {}
    device::ExchangeStatus exchange(const device::MotorCommand& command, device::BoardReading& reading,
                                    std::int64_t now_ns) HAPTIC_RT override {
        if (unplugged) {
            return device::ExchangeStatus::Disconnected;
        }
        const device::ExchangeStatus status = board_->exchange(command, reading, now_ns);
        reading.buttons = buttons;
        return status;
    }
    void zero_motors(std::int64_t now_ns) HAPTIC_RT override { board_->zero_motors(now_ns); }

    std::atomic<std::uint32_t> buttons{0};
    std::atomic<bool> unplugged{false};

  private:
    device::Board* board_;
};

/// A loop with a real thread and clock on an emulated board.
class RealtimeLoopTest : public testing::Test {
  protected:
    RealtimeLoopTest()
        : board({.geometry = settings.geometry}),
          frames(session),
          states(session),
          tick(settings, handled, frames, states, &monotonic_now_ns) {
        loop_settings.warm_up_ticks = 20;
    }

    void wait_until(RealtimeLoop& loop, bool (*reached)(const RealtimeLoop&)) {
        const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(20);
        while (!reached(loop) && std::chrono::steady_clock::now() < limit) {
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
        }
        ASSERT_TRUE(reached(loop));
    }

    static TickSettings quick() {
        TickSettings quick_settings;
        quick_settings.safety.tension_ramp_ns = 50'000'000;
        quick_settings.safety.calibration_hold_ns = 20'000'000;
        // Scheduling delays of the test machine are not under test.
        quick_settings.safety.late_share = 1.0;
        return quick_settings;
    }

    TickSettings settings = quick();
    LoopSettings loop_settings;
    std::string session = test::unique_session();
    device::EmulatedBoard board;
    HandledBoard handled{board};
    RingReader<ContactFrame> frames;
    RingWriter<DeviceState> states;
    Tick tick;
};

TEST_F(RealtimeLoopTest, ArmsRunsAndEndsWithZerosAtTheMotors) {
    RealtimeLoop loop(loop_settings, tick, {});
    Recorder recorder(16384);
    loop.start(&recorder);
    wait_until(loop, [](const RealtimeLoop& l) { return l.safety_state() == SafetyState::Running; });
    loop.request_stop();
    wait_until(loop, [](const RealtimeLoop& l) { return l.finished(); });
    loop.join();
    EXPECT_EQ(tick.faults(), static_cast<std::uint32_t>(HAPTIC_FAULT_STOP));
    for (const double tension : board.device().tensions()) {
        EXPECT_EQ(tension, 0.0);
    }
    // Every deadline is the first one plus whole periods: no drift.
    TickRecord record;
    ASSERT_TRUE(recorder.pop(record));
    const std::int64_t phase_ns = record.deadline_ns % settings.period_ns;
    std::uint64_t ticks = 1;
    while (recorder.pop(record)) {
        ASSERT_EQ(record.deadline_ns % settings.period_ns, phase_ns);
        ASSERT_GE(record.now_ns, record.deadline_ns);
        ++ticks;
    }
    EXPECT_EQ(ticks, tick.instruments().ticks + 20) << "the ticks of the warm-up are recorded, but not measured";
}

TEST_F(RealtimeLoopTest, CanBeStoppedBeforeItWasStartedOrArmed) {
    {
        const RealtimeLoop never_started(loop_settings, tick, {});
    }
    RealtimeLoop loop(loop_settings, tick, {});
    loop.request_stop();
    loop.start();
    wait_until(loop, [](const RealtimeLoop& l) { return l.finished(); });
    EXPECT_EQ(tick.safety_state(), SafetyState::Disarmed);
}

TEST_F(RealtimeLoopTest, IsStoppedWithoutAFaultRightAfterALostDeviceIsBack) {
    {
        RealtimeLoop loop(loop_settings, tick, {});
        loop.start();
        wait_until(loop, [](const RealtimeLoop& l) { return l.safety_state() == SafetyState::Running; });
        handled.unplugged = true;
        wait_until(loop, [](const RealtimeLoop& l) { return l.finished(); });
        ASSERT_NE(tick.faults() & HAPTIC_FAULT_EXCHANGE, 0U);
    }
    // Longer than the exchanges of recent time that are judged.
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    handled.unplugged = false;
    RealtimeLoop loop(loop_settings, tick, {});
    loop.request_stop();
    loop.start();
    wait_until(loop, [](const RealtimeLoop& l) { return l.finished(); });
    EXPECT_EQ(tick.faults(), static_cast<std::uint32_t>(HAPTIC_FAULT_STOP));
}

TEST_F(RealtimeLoopTest, StaysDisarmedAndPublishesPosesUntilAPersonActs) {
    ArmSwitch person;
    EXPECT_FALSE(person.press(ArmedBy::Command)) << "too early";
    RealtimeLoop loop(loop_settings, tick, {});
    Recorder recorder(65536);
    RingReader<DeviceState> published(session);
    loop.start(&recorder, nullptr, &person);
    std::this_thread::sleep_for(std::chrono::milliseconds(400));
    DeviceState state{};
    ASSERT_TRUE(published.read_newest(state));
    EXPECT_EQ(state.safety_state, static_cast<std::uint32_t>(HAPTIC_DISARMED));
    EXPECT_NE(state.tick_flags & HAPTIC_TICK_ARM_AWAITED, 0U);
    ASSERT_TRUE(published.read_newest(state) ||
                (std::this_thread::sleep_for(std::chrono::milliseconds(50)), published.read_newest(state)))
        << "states go on while it waits";
    ASSERT_TRUE(person.press(ArmedBy::Command));
    wait_until(loop, [](const RealtimeLoop& l) { return l.safety_state() == SafetyState::Running; });
    loop.request_stop();
    wait_until(loop, [](const RealtimeLoop& l) { return l.finished(); });
    loop.join();
    // Not one code before the act.
    TickRecord record;
    bool armed = false;
    std::uint64_t before = 0;
    while (recorder.pop(record)) {
        armed = armed || (record.requests & kRequestArm) != 0;
        if (!armed) {
            ++before;
            ASSERT_EQ(record.command.dac_codes, device::MotorCommand{}.dac_codes);
            ASSERT_EQ(record.safety_state, static_cast<std::uint32_t>(HAPTIC_DISARMED));
        } else {
            ASSERT_EQ(record.flags & HAPTIC_TICK_ARM_AWAITED, 0U);
        }
    }
    EXPECT_GT(before, 100U);
    EXPECT_LT(tick.instruments().ticks + before, recorder.dropped() + 65536U);
    EXPECT_FALSE(loop.lost());
}

TEST_F(RealtimeLoopTest, ArmsByAButtonThatIsHeldAfterItWasReleased) {
    loop_settings.arm_button = 1;
    ArmSwitch person;
    handled.buttons = 0b10;  // held already when the wait begins
    RealtimeLoop loop(loop_settings, tick, {});
    loop.start(nullptr, nullptr, &person);
    std::this_thread::sleep_for(std::chrono::milliseconds(1300));
    EXPECT_TRUE(person.awaited());
    handled.buttons = 0b01;  // another button
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    handled.buttons = 0b10;
    wait_until(loop, [](const RealtimeLoop& l) { return l.safety_state() == SafetyState::Running; });
    EXPECT_TRUE(person.pressed());
    EXPECT_EQ(person.by(), ArmedBy::Button);
}

TEST_F(RealtimeLoopTest, EndsWithoutArmingWhenTheDeviceIsLostMeanwhile) {
    ArmSwitch person;
    RealtimeLoop loop(loop_settings, tick, {});
    loop.start(nullptr, nullptr, &person);
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    handled.unplugged = true;
    wait_until(loop, [](const RealtimeLoop& l) { return l.finished(); });
    EXPECT_EQ(loop.lost(), device::ExchangeStatus::Disconnected);
    EXPECT_FALSE(person.press(ArmedBy::Command)) << "nobody awaits it any more";
}

TEST_F(RealtimeLoopTest, EndsWithoutPullingWhenItIsStoppedWhileItWaits) {
    ArmSwitch person;
    RealtimeLoop loop(loop_settings, tick, {});
    Recorder recorder(16384);
    loop.start(&recorder, nullptr, &person);
    wait_until(loop, [](const RealtimeLoop& l) { return l.safety_state() == SafetyState::Disarmed; });
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    loop.request_stop();
    wait_until(loop, [](const RealtimeLoop& l) { return l.finished(); });
    loop.join();
    EXPECT_EQ(tick.faults(), static_cast<std::uint32_t>(HAPTIC_FAULT_STOP));
    TickRecord record;
    while (recorder.pop(record)) {
        ASSERT_EQ(record.command.dac_codes, device::MotorCommand{}.dac_codes);
    }
}

TEST_F(RealtimeLoopTest, NamesRefusedPrivilegesAndTheirRemedies) {
    loop_settings.cpu = 1023;  // does not exist on any test machine
    const RealtimeLoop loop(loop_settings, tick, {});
    const std::vector<MissingPrivilege>& missing = loop.setup().missing;
    ASSERT_FALSE(missing.empty());
    EXPECT_TRUE(loop.setup().degraded());
    EXPECT_THAT(missing.front().what, HasSubstr("not pinned to processor 1023"));
    EXPECT_EQ(loop.setup().cpu, -1);
    for (const MissingPrivilege& one : missing) {
        EXPECT_FALSE(one.needs.empty());
        EXPECT_FALSE(one.remedy.empty());
    }
}

TEST_F(RealtimeLoopTest, HasNoPageFaultsAfterWarmUp) {
    RealtimeSetup setup;
    prepare_process(setup);
    if (!setup.memory_locked) {
        GTEST_SKIP() << setup.missing.front().what << "; it needs " << setup.missing.front().needs;
    }
    if (locked_kilobytes() == 0) {
        GTEST_SKIP() << "mlockall() succeeds and locks nothing: sanitizers make it so";
    }
    Recorder recorder(16384);
    RealtimeLoop loop(loop_settings, tick, setup);
    loop.start(&recorder);
    RingWriter<ContactFrame> writer(session);
    for (int i = 0; i < 100; ++i) {
        ContactFrame frame = test::floor_frame(0.001, 300.0, monotonic_now_ns());
        writer.publish(frame, frame.publish_time_ns);
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    loop.request_stop();
    wait_until(loop, [](const RealtimeLoop& l) { return l.finished(); });
    loop.join();
    EXPECT_GT(tick.instruments().contact_ticks, 50u);
    EXPECT_EQ(loop.usage().page_faults, 0);
    munlockall();
}

}  // namespace
}  // namespace haptic::rt
