// Background work: tasks that take longer than a step.
#pragma once

#include <pthread.h>
#include <sched.h>

#include <future>
#include <utility>

namespace haptic::sim {

/// Calls `work` on a new thread under SCHED_OTHER, whatever the policy of the caller, so that it cannot delay a
/// real-time run. The future's destructor waits for it.
template <class Work>
[[nodiscard]] auto in_background(Work work) {
    return std::async(std::launch::async, [work = std::move(work)] {
        const sched_param none{};
        (void)pthread_setschedparam(pthread_self(), SCHED_OTHER, &none);
        return work();
    });
}

}  // namespace haptic::sim
