// System calls of the running real-time thread. Those of the board's transport are with the transport.
#pragma once

#include <cstdint>

#include "haptic/realtime.hpp"

namespace haptic::rt {

/// Sleeps until a time of CLOCK_MONOTONIC; returns at once if it has passed.
void sleep_until(std::int64_t deadline_ns) HAPTIC_RT;

/// Never returns. For a thread whose records were taken over by another one.
[[noreturn]] void sleep_for_ever() HAPTIC_RT;

/// The kernel's counters of the calling thread since its start.
struct ThreadUsage {
    std::int64_t page_faults = 0;         // minor and major
    std::int64_t voluntary_switches = 0;  // it slept
    std::int64_t forced_switches = 0;     // it was preempted

    ThreadUsage& operator+=(const ThreadUsage& more) noexcept {
        page_faults += more.page_faults;
        voluntary_switches += more.voluntary_switches;
        forced_switches += more.forced_switches;
        return *this;
    }
};
[[nodiscard]] inline ThreadUsage operator-(const ThreadUsage& later, const ThreadUsage& earlier) HAPTIC_RT {
    return {later.page_faults - earlier.page_faults, later.voluntary_switches - earlier.voluntary_switches,
            later.forced_switches - earlier.forced_switches};
}
[[nodiscard]] ThreadUsage thread_usage() HAPTIC_RT;

/// ns, total time since its start that a thread was runnable without a processor. `file`: its open
/// /proc/thread-self/schedstat. -1 if the kernel does not provide it.
[[nodiscard]] std::int64_t waited_for_processor_ns(int file) HAPTIC_RT;

}  // namespace haptic::rt
