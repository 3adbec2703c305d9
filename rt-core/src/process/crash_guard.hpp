// Crash guard: sets the motors to zero on every abnormal exit of the process, because the boards hold the last command.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "process/motor_gate.hpp"

namespace haptic::rt {

/// While it exists, the following close the gate, so that zeros are the last command, and then take their usual effect:
///   - every signal that would terminate the process: SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT (std::terminate, failed
///     assertions); and, unless the process handles or ignores them, SIGTRAP, SIGSYS, SIGQUIT, SIGXCPU, SIGXFSZ,
///     SIGALRM, SIGVTALRM, SIGPROF, SIGUSR1, SIGUSR2, SIGIO, SIGPWR, SIGSTKFLT and the real-time signals;
///   - exit() and quick_exit(), from any thread.
/// A stack overflow raises SIGSEGV, which is handled if the thread has an AlternateSignalStack. _exit(), SIGKILL and a
/// crash of the machine send nothing, so the power of the motors needs a switch of its own. Only one may exist in a
/// process: throws std::logic_error otherwise.
class CrashGuard {
  public:
    explicit CrashGuard(MotorGate& gate);
    CrashGuard(const CrashGuard&) = delete;
    CrashGuard& operator=(const CrashGuard&) = delete;
    ~CrashGuard();

  private:
    std::vector<int> signals_;
};

/// RAII alternate signal stack of the calling thread, so that an overflow of its own stack can be handled.
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
