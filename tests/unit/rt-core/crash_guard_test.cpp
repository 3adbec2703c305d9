#include "haptic/rt/crash_guard.hpp"

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <exception>
#include <stdexcept>
#include <string>

namespace haptic::rt {
namespace {

/// A board whose digits another process can see.
class SharedBoard final : public device::Board {
  public:
    explicit SharedBoard(device::MotorCommand* seen) : seen_(seen) {}
    device::ExchangeStatus exchange(const device::MotorCommand& command, device::BoardReading& /*reading*/,
                                    std::int64_t /*now_ns*/) HAPTIC_RT override {
        *seen_ = command;
        return device::ExchangeStatus::Ok;
    }
    void zero_motors(std::int64_t /*now_ns*/) HAPTIC_RT override { *seen_ = device::MotorCommand{}; }

  private:
    device::MotorCommand* seen_;
};

struct Crash {
    const char* name;
    int signal;
    void (*act)();
};

class CrashGuardTest : public testing::TestWithParam<Crash> {};

TEST_P(CrashGuardTest, SendsZerosAndDiesOfTheSameSignal) {
    void* const memory =
        mmap(nullptr, sizeof(device::MotorCommand), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    ASSERT_NE(memory, MAP_FAILED);
    auto* const seen = new (memory) device::MotorCommand;
    seen->digits.fill(1234);

    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
        SharedBoard board(seen);
        const AlternateSignalStack stack;
        const CrashGuard guard(board);
        GetParam().act();
        _exit(0);
    }
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    EXPECT_TRUE(WIFSIGNALED(status));
    EXPECT_EQ(WTERMSIG(status), GetParam().signal);
    for (const std::int16_t digit : seen->digits) {
        EXPECT_EQ(digit, 0);
    }
    munmap(memory, sizeof(device::MotorCommand));
}

INSTANTIATE_TEST_SUITE_P(Each, CrashGuardTest,
                         testing::Values(Crash{"Segv", SIGSEGV, [] { kill(getpid(), SIGSEGV); }},
                                         Crash{"Bus", SIGBUS, [] { std::raise(SIGBUS); }},
                                         Crash{"Fpe", SIGFPE, [] { std::raise(SIGFPE); }},
                                         Crash{"Ill", SIGILL, [] { std::raise(SIGILL); }},
                                         Crash{"Abort", SIGABRT, [] { std::abort(); }},
                                         Crash{"Terminate", SIGABRT, [] { std::terminate(); }}),
                         [](const testing::TestParamInfo<Crash>& param) { return param.param.name; });

TEST(CrashGuard, IsOneAtATime) {
    device::MotorCommand seen;
    SharedBoard board(&seen);
    {
        const CrashGuard guard(board);
        EXPECT_THROW(const CrashGuard second(board), std::logic_error);
    }
    EXPECT_NO_THROW(const CrashGuard again(board));
}

}  // namespace
}  // namespace haptic::rt
