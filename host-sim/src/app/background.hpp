// Work beside a run that takes longer than a step may.
#pragma once

#include <pthread.h>
#include <sched.h>

#include <future>
#include <utility>

namespace haptic::sim {

/// Calls `work` on a thread of its own with the ordinary scheduling policy, whatever that of the process is, so that it
/// never keeps the run from its deadlines. The future waits for it at its end.
template <class Work>
[[nodiscard]] auto in_background(Work work) {
    return std::async(std::launch::async, [work = std::move(work)] {
        const sched_param none{};
        (void)pthread_setschedparam(pthread_self(), SCHED_OTHER, &none);
        return work();
    });
}

}  // namespace haptic::sim
