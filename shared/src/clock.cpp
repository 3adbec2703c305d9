#include "haptic/clock.hpp"

#include <ctime>

#include "haptic/types.hpp"

namespace haptic {

std::int64_t monotonic_now_ns() HAPTIC_RT {
    timespec now{};
    HAPTIC_RT_EXCEPTION_BEGIN("a vDSO read of the clock page: no system call, below 100 ns")
    clock_gettime(CLOCK_MONOTONIC, &now);
    HAPTIC_RT_EXCEPTION_END
    return now.tv_sec * kNanosecondsPerSecond + now.tv_nsec;
}

std::int64_t real_minus_monotonic_ns() {
    timespec real{};
    clock_gettime(CLOCK_REALTIME, &real);
    return real.tv_sec * kNanosecondsPerSecond + real.tv_nsec - monotonic_now_ns();
}

}  // namespace haptic
