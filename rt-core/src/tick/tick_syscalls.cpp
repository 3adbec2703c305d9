#include "tick/tick_syscalls.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
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
        "waiting is the purpose; it ends at an absolute time, so that repeating it after a signal adds "
        "nothing")
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
        "reads counters of the calling thread and takes no lock that another thread holds for long; about "
        "a microsecond. Called at the beginning and end of a run, and in a measured run at the end of each tick")
    getrusage(RUSAGE_THREAD, &usage);
    HAPTIC_RT_EXCEPTION_END
    return {usage.ru_minflt + usage.ru_majflt, usage.ru_nvcsw, usage.ru_nivcsw};
}

std::int64_t waited_for_processor_ns(int file) HAPTIC_RT {
    std::array<char, 64> text{};
    ssize_t length = 0;
    HAPTIC_RT_EXCEPTION_BEGIN(
        "the kernel prints three counters of the calling thread into a buffer that it allocated at the first read; "
        "about a microsecond, and only in a measured run, after the exchange with the motors")
    length = pread(file, text.data(), text.size(), 0);
    HAPTIC_RT_EXCEPTION_END
    // Skip the first of three numbers, then parse the second: time spent waiting in the run queue. -1 if incomplete.
    ssize_t at = 0;
    while (at < length && text[static_cast<std::size_t>(at)] != ' ') {
        ++at;
    }
    std::int64_t waited_ns = -1;
    for (++at; at < length; ++at) {
        const char digit = text[static_cast<std::size_t>(at)];
        if (digit < '0' || digit > '9') {
            return waited_ns;
        }
        waited_ns = 10 * std::max<std::int64_t>(waited_ns, 0) + (digit - '0');
    }
    return -1;
}

}  // namespace haptic::rt
