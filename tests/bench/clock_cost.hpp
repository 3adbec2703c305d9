// Timing of calls that are too short for the benchmark library's own loop, where percentiles matter.
#pragma once

#include <algorithm>
#include <chrono>

namespace haptic::bench {

using Clock = std::chrono::steady_clock;

inline double nanoseconds_between(Clock::time_point start, Clock::time_point end) {
    return static_cast<double>(std::chrono::duration_cast<std::chrono::nanoseconds>(end - start).count());
}

/// ns, what two readings of the clock cost when nothing is between them.
inline double clock_cost() {
    double minimum = 1e9;
    for (int k = 0; k < 10000; ++k) {
        const auto start = Clock::now();
        minimum = std::min(minimum, nanoseconds_between(start, Clock::now()));
    }
    return minimum;
}

}  // namespace haptic::bench
