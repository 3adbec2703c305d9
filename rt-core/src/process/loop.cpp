#include "process/loop.hpp"

#include <haptic/clock.hpp>

namespace haptic::rt {

NextDeadline next_deadline(std::int64_t deadline_ns, std::int64_t period_ns, std::int64_t now_ns) HAPTIC_RT {
    NextDeadline next{deadline_ns + period_ns, 0};
    if (next.deadline_ns <= now_ns) {
        next.missed = (now_ns - next.deadline_ns) / period_ns + 1;
        next.deadline_ns += next.missed * period_ns;
    }
    return next;
}

std::int64_t RealtimeLoop::run_one(std::int64_t deadline_ns, std::int64_t missed) HAPTIC_RT {
    sleep_until(deadline_ns);
    tick_->run({deadline_ns, monotonic_now_ns(), missed});
    state_.store(tick_->safety_state(), std::memory_order_relaxed);
    return monotonic_now_ns();
}

void RealtimeLoop::warm_up(std::int64_t& deadline_ns) HAPTIC_RT {
    for (int i = 0; i < settings_.warm_up_ticks && !stop_requested_.load(std::memory_order_relaxed); ++i) {
        deadline_ns = next_deadline(deadline_ns, settings_.period_ns, run_one(deadline_ns, 0)).deadline_ns;
    }
    tick_->set_instruments(*measured_);
}

void RealtimeLoop::cycle() HAPTIC_RT {
    tick_->heart().begin();
    NextDeadline next{monotonic_now_ns() + settings_.period_ns, 0};
    tick_->record_to(recorder_);  // from the first tick on: a replay begins with a tick as new as this one
    warm_up(next.deadline_ns);
    tick_->arm();
    const ThreadUsage before = thread_usage();
    if (log_ != nullptr) {
        log_->begin();
    }
    // Disarmed again: stopped or faulted, and faded out. relaxed: the flag carries nothing but itself.
    do {
        if (stop_requested_.load(std::memory_order_relaxed)) {
            tick_->stop();
        }
        next = next_deadline(next.deadline_ns, settings_.period_ns, run_one(next.deadline_ns, next.missed));
        if (log_ != nullptr) {
            log_->add(tick_->last(), tick_->timing(), next.missed);
        }
    } while (tick_->safety_state() != SafetyState::Disarmed);
    const ThreadUsage after = thread_usage();
    usage_ = after - before;
    tick_->send_zero(monotonic_now_ns());
    tick_->heart().end();
}

}  // namespace haptic::rt
