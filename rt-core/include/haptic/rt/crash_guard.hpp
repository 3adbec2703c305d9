// Zeros to the motors when the process crashes: the boards hold the last value that they were sent.
#pragma once

#include <cstddef>
#include <memory>

#include "haptic/device/board.hpp"

namespace haptic::rt {

/// While one lives, a fatal signal (SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT; also std::terminate) sends one command of
/// zeros to the board, then does what it would have done. One at a time in a process: throws std::logic_error
/// otherwise. A process that is killed by SIGKILL sends nothing; the power of the motors needs its own switch.
class CrashGuard {
  public:
    explicit CrashGuard(device::Board& board);
    CrashGuard(const CrashGuard&) = delete;
    CrashGuard& operator=(const CrashGuard&) = delete;
    ~CrashGuard();
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
