// Zeros to the motors on every way out of the process that is not its normal end: the boards hold the last value that
// they were sent.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "process/motor_gate.hpp"

namespace haptic::rt {

/// While one lives, these close the gate, so that zeros are sent and nothing else after them, and then go on as they
/// would have done without it:
///   - every signal that would end the process and that the process has made no other arrangement for: SIGSEGV, SIGBUS,
///     SIGFPE, SIGILL, SIGABRT (std::terminate, failed assertions), SIGTRAP, SIGSYS, SIGQUIT, SIGXCPU, SIGXFSZ,
///     SIGALRM, SIGVTALRM, SIGPROF, SIGUSR1, SIGUSR2, SIGIO, SIGPWR, SIGSTKFLT and the real-time signals;
///   - exit() and quick_exit(), from whatever thread.
/// A stack overflow is one of SIGSEGV's where the thread has an AlternateSignalStack. _exit(), SIGKILL and a machine
/// that stops send nothing; the power of the motors needs its own switch. One at a time in a process: throws
/// std::logic_error otherwise.
class CrashGuard {
  public:
    explicit CrashGuard(MotorGate& gate);
    CrashGuard(const CrashGuard&) = delete;
    CrashGuard& operator=(const CrashGuard&) = delete;
    ~CrashGuard();

  private:
    std::vector<int> signals_;
};

/// A stack for signal handlers of the calling thread, so that an overflow of its own stack is also handled.
class AlternateSignalStack {
  public:
    AlternateSignalStack();
    AlternateSignalStack(const AlternateSignalStack&) = delete;
    AlternateSignalStack& operator=(const AlternateSignalStack&) = delete;
    ~AlternateSignalStack();

  private:
    std::unique_ptr<std::byte[]> memory_;
};

}  // namespace haptic::rt
