#include "process/timing_log.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>

namespace haptic::rt {

std::int64_t latency_of(const TimedTick& tick, Latency latency) HAPTIC_RT {
    switch (latency) {
        case Latency::Wakeup:
            return tick.wakeup_ns();
        case Latency::Period:
            return tick.period_ns > 0 ? tick.period_ns : -1;
        case Latency::Compute:
            return tick.compute_ns;
        case Latency::Exchange:
            return tick.timing.of(TickStage::Exchange);
        case Latency::DeviceToPlane:
            return tick.timing.state_age_ns;
        case Latency::MotionToForce:
            return tick.timing.motion_to_force_ns;
    }
    return -1;
}

void TimingLog::attach() {
    thread_.store(gettid(), std::memory_order_relaxed);
    deadline_ns_.store(-1, std::memory_order_relaxed);
    if (schedstat_fd_ >= 0) {
        close(schedstat_fd_);
    }
    // Missing on kernels built without CONFIG_SCHED_INFO; then each tick has waited_ns = -1.
    schedstat_fd_ = open("/proc/thread-self/schedstat", O_RDONLY | O_CLOEXEC);
    if (schedstat_fd_ >= 0) {
        (void)waited_for_processor_ns(schedstat_fd_);  // first read: the kernel allocates its buffer
    }
}

TimingLog::~TimingLog() {
    if (schedstat_fd_ >= 0) {
        close(schedstat_fd_);
    }
}

std::int64_t TimingLog::total_wait_ns() const HAPTIC_RT {
    return schedstat_fd_ >= 0 ? waited_for_processor_ns(schedstat_fd_) : -1;
}

void TimingLog::begin() HAPTIC_RT {
    usage_ = thread_usage();
    waited_ns_ = total_wait_ns();
}

void TimingLog::add(const TickRecord& record, const TickTiming& timing, std::int64_t missed) HAPTIC_RT {
    // The times of the tick.
    TimedTick tick;
    tick.number = record.number;
    tick.deadline_ns = record.deadline_ns;
    tick.now_ns = record.now_ns;
    tick.period_ns = record.period_ns;
    tick.compute_ns = record.compute_ns;
    tick.missed = missed;
    tick.timing = timing;
    tick.safety_state = record.safety_state;
    tick.exchange_in = record.exchange_in;
    tick.exchange_out = record.exchange_out;
    tick.exchange_collected = record.exchange_collected;

    // What the kernel counted of the thread since the end of the previous tick.
    const ThreadUsage usage = thread_usage();
    tick.usage = usage - usage_;
    usage_ = usage;
    const std::int64_t waited_ns = total_wait_ns();
    tick.waited_ns = waited_ns >= 0 && waited_ns_ >= 0 ? waited_ns - waited_ns_ : -1;
    waited_ns_ = waited_ns;

    deadline_ns_.store(tick.deadline_ns, std::memory_order_relaxed);
    // Total and queue; then an event if the tick is one to explain.
    missed_ += static_cast<std::uint64_t>(std::max<std::int64_t>(missed, 0));
    if (TickLatencies* const latencies = latencies_.claim(); latencies != nullptr) {
        *latencies = {tick.now_ns, tick.wakeup_ns(), tick.period_ns, tick.compute_ns};
        latencies_.commit();
    }
    if (break_ns_ >= 0 && tick.lateness_ns() > break_ns_ && !is_broken_.load(std::memory_order_relaxed)) {
        broken_ = tick;
        is_broken_.store(true, std::memory_order_release);
    }
    if (keep(tick)) {
        if (std::int64_t* const event = events_.claim(); event != nullptr) {
            *event = tick.now_ns;
            events_.commit();
        }
    }
}

bool TimingLog::keep(const TimedTick& tick) HAPTIC_RT {
    bool kept = false;
    if (tick.missed > 0) {
        if (late_ticks_ < kLate) {
            late_[late_ticks_] = tick;
            kept = true;
        }
        ++late_ticks_;
    }
    // Largest value of each latency.
    for (std::size_t i = 0; i < kLatencies; ++i) {
        const auto latency = static_cast<Latency>(i);
        const std::int64_t value_ns = latency_of(tick, latency);
        if (value_ns >= 0 && (largest_[i].number == 0 || value_ns > latency_of(largest_[i], latency))) {
            largest_[i] = tick;
            kept = true;
        }
    }
    // Insertion into the descending list of the latest ticks.
    std::size_t rank = worst_count_;
    while (rank > 0 && worst_[rank - 1].lateness_ns() < tick.lateness_ns()) {
        --rank;
    }
    if (rank == kWorst) {
        return kept;
    }
    worst_count_ = std::min(worst_count_ + 1, kWorst);
    for (std::size_t i = worst_count_ - 1; i > rank; --i) {
        worst_[i] = worst_[i - 1];
    }
    worst_[rank] = tick;
    return true;
}

bool TimingLog::take_event(std::int64_t& now_ns) HAPTIC_RT {
    const std::int64_t* const event = events_.front();
    if (event == nullptr) {
        return false;
    }
    now_ns = *event;
    events_.release();
    return true;
}

bool TimingLog::take_latencies(TickLatencies& latencies) HAPTIC_RT {
    const TickLatencies* const next = latencies_.front();
    if (next == nullptr) {
        return false;
    }
    latencies = *next;
    latencies_.release();
    return true;
}

}  // namespace haptic::rt
