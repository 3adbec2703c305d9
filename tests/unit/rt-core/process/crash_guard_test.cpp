#include "process/crash_guard.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <exception>
#include <stdexcept>
#include <string>

#include "shared_board.hpp"

namespace haptic::rt {
namespace {

using test::SharedBoard;
using test::SharedMotors;
using test::SharedMotorsPage;

struct Crash {
    const char* name;
    int signal;
    void (*act)();
};

class CrashGuardTest : public testing::TestWithParam<Crash> {};

TEST_P(CrashGuardTest, SendsZerosAndDiesOfTheSameSignal) {
    SharedMotorsPage motors;
    device::MotorCommand command;
    command.dac_codes.fill(1234);
    motors->set(command);

    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
        SharedBoard board(*motors);
        MotorGate gate(board);
        const AlternateSignalStack stack;
        const CrashGuard guard(gate);
        GetParam().act();
        _exit(0);
    }
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    EXPECT_TRUE(WIFSIGNALED(status));
    EXPECT_EQ(WTERMSIG(status), GetParam().signal);
    EXPECT_EQ(motors->sum(), 0);
}

INSTANTIATE_TEST_SUITE_P(Each, CrashGuardTest,
                         testing::Values(Crash{"Segv", SIGSEGV, [] { kill(getpid(), SIGSEGV); }},
                                         Crash{"Bus", SIGBUS, [] { std::raise(SIGBUS); }},
                                         Crash{"Fpe", SIGFPE, [] { std::raise(SIGFPE); }},
                                         Crash{"Ill", SIGILL, [] { std::raise(SIGILL); }},
                                         Crash{"Quit", SIGQUIT, [] { kill(getpid(), SIGQUIT); }},
                                         Crash{"Trap", SIGTRAP, [] { std::raise(SIGTRAP); }},
                                         Crash{"CpuTime", SIGXCPU, [] { kill(getpid(), SIGXCPU); }},
                                         Crash{"FileSize", SIGXFSZ, [] { kill(getpid(), SIGXFSZ); }},
                                         Crash{"User", SIGUSR1, [] { kill(getpid(), SIGUSR1); }},
                                         Crash{"Alarm", SIGALRM, [] { kill(getpid(), SIGALRM); }},
                                         Crash{"RealTimeSignal", SIGRTMIN + 3, [] { kill(getpid(), SIGRTMIN + 3); }},
                                         Crash{"Abort", SIGABRT, [] { std::abort(); }},
                                         Crash{"Terminate", SIGABRT, [] { std::terminate(); }}),
                         [](const testing::TestParamInfo<Crash>& param) { return param.param.name; });

TEST(CrashGuard, ExistsOnceAtATime) {
    SharedMotors motors;
    SharedBoard board(motors);
    MotorGate gate(board);
    {
        const CrashGuard guard(gate);
        EXPECT_THROW(const CrashGuard second(gate), std::logic_error);
    }
    EXPECT_NO_THROW(const CrashGuard again(gate));
}

}  // namespace
}  // namespace haptic::rt
