#include "haptic/clock.hpp"

#include <ctime>
#include <limits>

#include "haptic/types.hpp"

namespace haptic {
namespace {

constexpr int kReadings = 5;
constexpr std::int64_t kQuickNs = 1'000;  // as long as both clocks take when nothing comes between

}  // namespace

std::int64_t monotonic_now_ns() HAPTIC_RT {
    timespec now{};
    HAPTIC_RT_EXCEPTION_BEGIN("a vDSO read of the clock page: no system call, below 100 ns")
    clock_gettime(CLOCK_MONOTONIC, &now);
    HAPTIC_RT_EXCEPTION_END
    return now.tv_sec * kNanosecondsPerSecond + now.tv_nsec;
}

std::int64_t real_minus_monotonic_ns() {
    // A preemption between the two clocks would shift the difference: take the quickest of some readings.
    std::int64_t quickest_ns = std::numeric_limits<std::int64_t>::max();
    std::int64_t difference_ns = 0;
    for (int i = 0; i < kReadings && quickest_ns > kQuickNs; ++i) {
        const std::int64_t before_ns = monotonic_now_ns();
        timespec real{};
        clock_gettime(CLOCK_REALTIME, &real);
        const std::int64_t taken_ns = monotonic_now_ns() - before_ns;
        if (taken_ns < quickest_ns) {
            quickest_ns = taken_ns;
            difference_ns = real.tv_sec * kNanosecondsPerSecond + real.tv_nsec - (before_ns + taken_ns / 2);
        }
    }
    return difference_ns;
}

}  // namespace haptic
