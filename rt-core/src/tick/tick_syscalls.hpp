// Every system call that the real-time thread makes once it is running. The board's transport has its own.
#pragma once

#include <cstdint>

#include <haptic/realtime.hpp>

namespace haptic::rt {

/// Sleeps until an instant of CLOCK_MONOTONIC; at once if it has passed.
void sleep_until(std::int64_t deadline_ns) HAPTIC_RT;

/// Never returns: for a thread whose work was taken away from it.
[[noreturn]] void sleep_for_ever() HAPTIC_RT;

/// What the kernel has counted of the calling thread since it began.
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

/// ns, for which the thread of this open /proc/thread-self/schedstat was ready to run and had no processor, since it
/// began; -1 if the kernel does not tell.
[[nodiscard]] std::int64_t waited_for_processor_ns(int file) HAPTIC_RT;

}  // namespace haptic::rt
