#include "process/watchdog.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <functional>
#include <thread>

#include "haptic/clock.hpp"
#include "process/crash_guard.hpp"
#include "process/loop.hpp"
#include "shared_board.hpp"
#include "tick_rig.hpp"

namespace haptic::rt {
namespace {

using test::SharedBoard;
using test::SharedMotors;
using test::SharedMotorsPage;
using test::sleep_ms;

/// A real loop with its watchdog, on a board whose motor values other threads can read.
struct WatchedLoop {
    explicit WatchedLoop(SharedMotors& shared, const WatchdogSettings& watchdog_settings)
        : motors(shared),
          board(shared),
          gate(board),
          frames(session),
          states(session),
          tick(tick_settings(), gate, frames, states, &monotonic_now_ns),
          watchdog(watchdog_settings, tick, gate),
          loop(loop_settings(), tick, {}) {
        loop.start();
    }

    static TickSettings tick_settings() {
        TickSettings settings;
        settings.safety.tension_ramp_ns = 50'000'000;
        settings.safety.calibration_hold_ns = 20'000'000;
        settings.safety.late_share = 1.0;
        return settings;
    }
    static LoopSettings loop_settings() {
        LoopSettings settings;
        settings.warm_up_ticks = 5;
        return settings;
    }
    /// Waits a bounded time; false if the condition stays false.
    static bool wait(const std::function<bool()>& condition) {
        const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(30);
        while (!condition() && std::chrono::steady_clock::now() < limit) {
            sleep_ms(2);
        }
        return condition();
    }
    bool wait_until_running() {
        return wait([this] { return loop.safety_state() == SafetyState::Running; });
    }

    SharedMotors& motors;
    std::string session = test::unique_session();
    SharedBoard board;
    MotorGate gate;
    RingReader<ContactFrame> frames;
    RingWriter<DeviceState> states;
    Tick tick;
    Watchdog watchdog;
    RealtimeLoop loop;
};

WatchdogSettings quick() {
    WatchdogSettings settings;
    settings.limit_ns = 300'000'000;
    return settings;
}

WatchdogSettings patient() {
    WatchdogSettings settings;
    settings.limit_ns = 1'000'000'000;
    return settings;
}

TEST(Watchdog, SendsZerosWhileAnExchangeHangsAndNamesTheFaultWhenItComesBack) {
    SharedMotors motors;
    WatchedLoop run(motors, patient());
    ASSERT_TRUE(run.wait_until_running());
    ASSERT_GT(motors.sum(), 0);
    motors.hang = true;
    ASSERT_TRUE(run.wait([&run] { return run.watchdog.fired(); }));
    EXPECT_TRUE(motors.hanging);
    EXPECT_EQ(motors.sum(), 0);
    motors.hang = false;
    ASSERT_TRUE(run.wait([&run] { return run.loop.finished(); }));
    run.loop.join();
    EXPECT_EQ(motors.sum(), 0) << "what the loop still had to say did not reach the motors";
    EXPECT_EQ(run.tick.faults() & HAPTIC_FAULT_WATCHDOG, static_cast<std::uint32_t>(HAPTIC_FAULT_WATCHDOG));
    EXPECT_EQ(run.tick.safety_state(), SafetyState::Disarmed);
    EXPECT_NE(run.tick.black_box().at(run.tick.black_box().size() - 1).faults & HAPTIC_FAULT_WATCHDOG, 0u);
}

TEST(Watchdog, ReleasesTheRecordsOfALoopThatHangsForGood) {
    SharedMotorsPage motors;
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
        WatchedLoop run(*motors, quick());
        const bool ran = run.wait_until_running();
        motors->hang = true;
        const bool fired = run.wait([&run] { return run.watchdog.fired(); });
        const bool ours = run.tick.abandon();
        const std::size_t ticks = run.tick.black_box().size();
        const std::uint64_t counted = run.tick.instruments().ticks;
        motors->hang = false;  // too late: the board's thread keeps sleeping
        sleep_ms(20);
        run.gate.close();  // overrides the command that was under way when the gate was closed
        const bool nothing_came = run.tick.black_box().size() == ticks && run.tick.instruments().ticks == counted;
        _exit(ran && fired && ours && ticks > 50 && nothing_came ? 0 : 1);
    }
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    EXPECT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), 0);
    EXPECT_EQ(motors->sum(), 0);
}

TEST(Watchdog, ExitsTheProcessWhenTheMainThreadHangsToo) {
    SharedMotorsPage motors;
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
        WatchdogSettings settings = quick();
        settings.grace_ns = 100'000'000;
        WatchedLoop run(*motors, settings);
        run.wait_until_running();
        motors->hang = true;
        // As after an exception in the main thread: the loop's destructor waits forever for the hanging loop.
        run.loop.join();
        _exit(0);
    }
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    EXPECT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), 3);
    EXPECT_EQ(motors->sum(), 0);
}

TEST(Watchdog, DoesNotMistakeASuspendedProcessForAHangingLoop) {
    SharedMotorsPage motors;
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
        WatchdogSettings settings;
        settings.limit_ns = 400'000'000;
        WatchedLoop run(*motors, settings);
        const bool ran = run.wait_until_running();
        motors->ready = true;
        const std::uint64_t before = run.tick.heart().beats();
        while (run.tick.heart().beats() < before + 1200) {
            sleep_ms(5);
        }
        const bool fired = run.watchdog.fired();
        const bool running = run.loop.safety_state() == SafetyState::Running;
        _exit(ran && !fired && running ? 0 : 1);
    }
    while (!motors->ready) {
        sleep_ms(5);
    }
    for (int stop = 0; stop < 2; ++stop) {
        sleep_ms(130);
        kill(child, SIGSTOP);
        sleep_ms(700);  // longer than the limit
        EXPECT_GT(motors->sum(), 0) << "a stopped process leaves its motors as they are";
        kill(child, SIGCONT);
    }
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    EXPECT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), 0);
}

TEST(Watchdog, EndsAtOnceWhateverItsLimit) {
    WatchdogSettings settings;
    settings.limit_ns =
        3600 * kNanosecondsPerSecond;  // a dependence on this limit would exceed the test's own time limit
    SharedMotors motors;
    for (int i = 0; i < 20; ++i) {
        SharedBoard board(motors);
        MotorGate gate(board);
        const std::string session = test::unique_session();
        RingReader<ContactFrame> frames(session);
        RingWriter<DeviceState> states(session);
        Tick tick({}, gate, frames, states, &monotonic_now_ns);
        const Watchdog watchdog(settings, tick, gate);
    }
    EXPECT_EQ(motors.zeros_sent, 0);
}

}  // namespace
}  // namespace haptic::rt
