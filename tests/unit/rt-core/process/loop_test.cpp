#include "process/loop.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mman.h>

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

/// A loop with a real thread and clock on an emulated board.
class RealtimeLoopTest : public testing::Test {
  protected:
    RealtimeLoopTest()
        : board({.geometry = settings.geometry}),
          frames(session),
          states(session),
          tick(settings, board, frames, states, &monotonic_now_ns) {
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
        quick_settings.safety.overrun_ticks = 100'000;
        return quick_settings;
    }

    TickSettings settings = quick();
    LoopSettings loop_settings;
    std::string session = test::unique_session();
    device::EmulatedBoard board;
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
