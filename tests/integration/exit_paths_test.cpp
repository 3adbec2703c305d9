// Every exit path of a process that drives motors leaves them at zero. The process is a child that runs a real loop on
// a board whose motor values are in shared memory, where they can be checked after its death.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <exception>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

#include "haptic/clock.hpp"
#include "process/crash_guard.hpp"
#include "process/loop.hpp"
#include "process/motor_gate.hpp"
#include "process/watchdog.hpp"
#include "ring_session.hpp"
#include "shared_board.hpp"

namespace haptic::rt {
namespace {

using test::SharedBoard;
using test::SharedMotors;
using test::SharedMotorsPage;
using test::sleep_ms;

/// The objects of rt-core from the board to the loop, constructed in the same order.
void drive(SharedMotors& motors, const haptic::test::RingSession& session,
           const std::function<void(RealtimeLoop&)>& act) {
    const AlternateSignalStack signal_stack;
    SharedBoard board(motors);
    MotorGate gate(board);
    RingReader<ContactFrame> frames(session.name());
    RingWriter<DeviceState> states(session.name());
    TickSettings settings;
    settings.safety.tension_ramp_ns = 50'000'000;
    settings.safety.calibration_hold_ns = 20'000'000;
    settings.safety.late_share = 1.0;
    Tick tick(settings, gate, frames, states, &monotonic_now_ns);
    const CrashGuard guard(gate);
    WatchdogSettings watchdog_settings;
    watchdog_settings.limit_ns = 2'000'000'000;
    watchdog_settings.grace_ns = 100'000'000;
    const Watchdog watchdog(watchdog_settings, tick, gate);
    RealtimeLoop loop({.warm_up_ticks = 5}, tick, {});
    loop.start();
    while (loop.safety_state() != SafetyState::Running) {
        sleep_ms(1);
    }
    motors.ready = true;
    act(loop);
    for (int i = 0; i < 20'000 && !loop.finished(); ++i) {
        sleep_ms(1);
    }
    if (!loop.finished()) {
        _exit(99);  // the exit path under test did not end the process
    }
}

struct WayOut {
    const char* name;
    int status;  // from waitpid(): the exit status, or 1000 + the signal number
    void (*act)(SharedMotors& motors, RealtimeLoop& loop);
    bool without_sanitizers = false;
};

void stop(RealtimeLoop& loop) {
    loop.request_stop();
}

/// Limits the stack of the main thread from here on, because the shell's limit may be "unlimited".
void overflow_stack() {
    rlimit limit{};
    if (getrlimit(RLIMIT_STACK, &limit) != 0) {
        _exit(98);
    }
    limit.rlim_cur = std::min<rlim_t>(limit.rlim_cur, rlim_t{8} << 20);
    if (setrlimit(RLIMIT_STACK, &limit) != 0) {
        _exit(98);
    }
    test::use_stack(test::kTooMuchStack);
}

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif

const WayOut kWaysOut[] = {
    {"OrderlyStop", 0, [](SharedMotors&, RealtimeLoop& loop) { stop(loop); }},
    {"OrderlyStopAskedForThrice", 0,
     [](SharedMotors&, RealtimeLoop& loop) {
         for (int i = 0; i < 3; ++i) {
             stop(loop);
             sleep_ms(20);
         }
     }},
    {"ExceptionThatMainCatches", 7,
     [](SharedMotors&, RealtimeLoop&) { throw std::runtime_error("in the main thread"); }},
    {"ExceptionThatNobodyCatches", 1000 + SIGABRT,
     [](SharedMotors&, RealtimeLoop&) { std::thread([] { throw std::runtime_error("in a thread"); }).join(); }},
    {"Terminate", 1000 + SIGABRT, [](SharedMotors&, RealtimeLoop&) { std::terminate(); }},
    {"Abort", 1000 + SIGABRT, [](SharedMotors&, RealtimeLoop&) { std::abort(); }},
    {"NullPointer", 1000 + SIGSEGV,
     [](SharedMotors&, RealtimeLoop&) {
         volatile int* volatile nowhere = nullptr;
         *nowhere = 1;
     },
     true},
    {"StackOverflowOfTheMainThread", 1000 + SIGSEGV, [](SharedMotors&, RealtimeLoop&) { overflow_stack(); }, true},
    {"StackOverflowOfTheLoop", 1000 + SIGSEGV,
     [](SharedMotors& motors, RealtimeLoop&) {
         motors.overflow = true;
         sleep_ms(10'000);
     },
     true},
    {"Exit", 5, [](SharedMotors&, RealtimeLoop&) { std::exit(5); }, true},
    {"ExitFromAnotherThread", 5, [](SharedMotors&, RealtimeLoop&) { std::thread([] { std::exit(5); }).join(); }, true},
    {"QuickExit", 6, [](SharedMotors&, RealtimeLoop&) { std::quick_exit(6); }},
    {"Quit", 1000 + SIGQUIT, [](SharedMotors&, RealtimeLoop&) { kill(getpid(), SIGQUIT), sleep_ms(10'000); }},
    {"CpuTimeUsedUp", 1000 + SIGXCPU, [](SharedMotors&, RealtimeLoop&) { kill(getpid(), SIGXCPU), sleep_ms(10'000); }},
    {"HangingBoard", 3,
     [](SharedMotors& motors, RealtimeLoop&) {
         motors.hang = true;
         sleep_ms(60'000);
     }},
};

class ExitPaths : public testing::TestWithParam<WayOut> {};

TEST_P(ExitPaths, LeaveTheMotorsAtZero) {
    const WayOut& way = GetParam();
    if (kSanitized && way.without_sanitizers) {
        GTEST_SKIP() << "the sanitizer has its own end for this";
    }
    const haptic::test::RingSession session;
    SharedMotorsPage motors;
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
        try {
            drive(*motors, session, [&](RealtimeLoop& loop) { way.act(*motors, loop); });
        } catch (const std::runtime_error&) {
            _exit(7);
        }
        _exit(0);
    }
    int peak = 0;
    int status = 0;
    while (waitpid(child, &status, WNOHANG) == 0) {
        peak = std::max(peak, motors->sum());
        sleep_ms(1);
    }
    EXPECT_TRUE(motors->ready) << "it came to run";
    EXPECT_GT(peak, 300) << "its motors were pulling";
    EXPECT_EQ(motors->sum(), 0);
    const int end = WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
    EXPECT_EQ(end, way.status);
}

INSTANTIATE_TEST_SUITE_P(Each, ExitPaths, testing::ValuesIn(kWaysOut),
                         [](const testing::TestParamInfo<WayOut>& param) { return std::string(param.param.name); });

TEST(Sigkill, LeavesTheMotorsPullingWhichIsWhyTheirPowerNeedsASwitch) {
    const haptic::test::RingSession session;
    SharedMotorsPage motors;
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
        drive(*motors, session, [](RealtimeLoop&) { sleep_ms(60'000); });
        _exit(0);
    }
    while (!motors->ready) {
        sleep_ms(1);
    }
    kill(child, SIGKILL);
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    EXPECT_GT(motors->sum(), 300);
}

}  // namespace
}  // namespace haptic::rt
