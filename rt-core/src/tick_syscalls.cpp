#include "haptic/rt/tick_syscalls.hpp"

#include <sys/resource.h>

#include <cerrno>
#include <ctime>
#include <limits>

#include "haptic/types.hpp"

namespace haptic::rt {

void sleep_until(std::int64_t deadline_ns) HAPTIC_RT {
    timespec deadline{};
    deadline.tv_sec = deadline_ns / kNanosecondsPerSecond;
    deadline.tv_nsec = deadline_ns % kNanosecondsPerSecond;
    HAPTIC_RT_EXCEPTION_BEGIN(
        "waiting is the purpose, and it ends at an absolute time, so that repeating it after a signal "
        "adds nothing")
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &deadline, nullptr) == EINTR) {
    }
    HAPTIC_RT_EXCEPTION_END
}

void sleep_for_ever() HAPTIC_RT {
    while (true) {
        sleep_until(std::numeric_limits<std::int64_t>::max());
    }
}

ThreadUsage thread_usage() HAPTIC_RT {
    rusage usage{};
    HAPTIC_RT_EXCEPTION_BEGIN(
        "reads counters of the calling thread, takes no lock that another thread holds for long; about "
        "a microsecond, and only at the beginning and the end of a run")
    getrusage(RUSAGE_THREAD, &usage);
    HAPTIC_RT_EXCEPTION_END
    return {usage.ru_minflt + usage.ru_majflt, usage.ru_nvcsw, usage.ru_nivcsw};
}

}  // namespace haptic::rt
