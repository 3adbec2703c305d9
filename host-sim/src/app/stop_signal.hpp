// How a person ends a run that has no end, and how the run waits without missing that.
#pragma once

#include <csignal>
#include <cstdint>

namespace haptic::sim {

/// While it lives, SIGINT, SIGTERM and SIGHUP end the run in an orderly way instead of the process.
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

/// One of them came since the last StopOnSignal began to live.
[[nodiscard]] bool stop_requested() noexcept;

/// Until a time of CLOCK_MONOTONIC, or until one of them comes.
void sleep_until(std::int64_t time_ns) noexcept;

}  // namespace haptic::sim
