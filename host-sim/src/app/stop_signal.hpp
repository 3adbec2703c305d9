// Stop signals: orderly end of a run on SIGINT, SIGTERM or SIGHUP, and a sleep that they interrupt.
#pragma once

#include <csignal>
#include <cstdint>

namespace haptic::sim {

/// While an object exists, these signals request a stop instead of terminating the process.
class StopOnSignal {
  public:
    StopOnSignal();
    StopOnSignal(const StopOnSignal&) = delete;
    StopOnSignal& operator=(const StopOnSignal&) = delete;
    ~StopOnSignal();

  private:
    struct sigaction old_interrupt_{};
    struct sigaction old_terminate_{};
    struct sigaction old_hangup_{};
};

/// A stop was requested since the last StopOnSignal was constructed.
[[nodiscard]] bool stop_requested() noexcept;

/// Sleeps until a time of CLOCK_MONOTONIC, ns, or until a stop is requested.
void sleep_until(std::int64_t time_ns) noexcept;

}  // namespace haptic::sim
