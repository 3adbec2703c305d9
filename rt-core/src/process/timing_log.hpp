// Timing log of a measurement: the worst ticks, with the kernel's counters of the thread, and a queue of the latencies
// of all ticks. Complements the histograms of Instruments.
//
// The loop's thread fills it at the end of each tick, after the motor command, at the cost of two system calls. It is
// read while no loop runs; only take_event() and take_latencies() may be called at any time, by one other thread.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

#include "haptic/realtime.hpp"
#include "tick/recorder.hpp"
#include "tick/tick_timing.hpp"

namespace haptic::rt {

/// Latencies whose distribution a measurement reports.
enum class Latency : std::uint8_t { Wakeup, Period, Compute, Exchange, DeviceToPlane, MotionToForce };
inline constexpr std::size_t kLatencies = 6;

/// A latency of one tick, ns; -1 if the tick has none.
[[nodiscard]] std::int64_t latency_of(const TimedTick& tick, Latency latency) HAPTIC_RT;

/// Latencies of one tick, queued for the course of the run.
struct TickLatencies {
    std::int64_t now_ns = 0;  // wake-up, CLOCK_MONOTONIC
    std::int64_t wakeup_ns = 0;
    std::int64_t period_ns = 0;  // 0: none, at the first tick
    std::int64_t compute_ns = 0;
};

class TimingLog {
  public:
    static constexpr std::size_t kWorst = 20;
    static constexpr std::size_t kLate = 1000;
    static constexpr std::size_t kQueued = 16384;  // latencies: 2 s at 8 kHz

    TimingLog() = default;
    TimingLog(const TimingLog&) = delete;
    TimingLog& operator=(const TimingLog&) = delete;
    ~TimingLog();

    /// Call in the loop's thread, before its first tick: opens the kernel's counters of the calling thread.
    void attach();
    /// Has the first tick kept that ends later than this after its deadline, ns. Call before the loop starts.
    void break_above(std::int64_t lateness_ns) noexcept { break_ns_ = lateness_ns; }
    /// That tick; nullptr as long as there is none. For any thread, at any time.
    [[nodiscard]] const TimedTick* broken() const noexcept {
        return is_broken_.load(std::memory_order_acquire) ? &broken_ : nullptr;
    }
    /// A deadline of the loop that runs, CLOCK_MONOTONIC; -1 before its first measured tick. For any thread, at any
    /// time.
    [[nodiscard]] std::int64_t a_deadline_ns() const noexcept { return deadline_ns_.load(std::memory_order_relaxed); }
    /// Number of the loop's thread, as the kernel has it; 0 before attach(). For any thread, at any time.
    [[nodiscard]] int thread() const noexcept { return thread_.load(std::memory_order_relaxed); }
    /// Call in the loop's thread: begins a segment. The counters start here.
    void begin() HAPTIC_RT;
    /// Adds a tick at its end. `missed`: further deadlines that had passed by then.
    void add(const TickRecord& record, const TickTiming& timing, std::int64_t missed) HAPTIC_RT;

    /// The ticks that ended latest after their deadlines, latest first.
    [[nodiscard]] std::span<const TimedTick> worst() const noexcept { return {worst_.data(), worst_count_}; }
    /// The first kLate ticks by whose end another deadline had passed, in order.
    [[nodiscard]] std::span<const TimedTick> late() const noexcept {
        return {late_.data(), std::min<std::size_t>(late_ticks_, kLate)};
    }
    /// The tick with the largest value of a latency; its number is 0 if no tick had a value.
    [[nodiscard]] const TimedTick& largest(Latency latency) const noexcept {
        return largest_[static_cast<std::size_t>(latency)];
    }
    /// Ticks by whose end another deadline had passed, and the number of those deadlines.
    [[nodiscard]] std::uint64_t late_ticks() const noexcept { return late_ticks_; }
    [[nodiscard]] std::uint64_t missed() const noexcept { return missed_; }

    /// Takes the wake-up time of the next tick that entered worst(), late() or largest(); false if there is none. For
    /// one other thread.
    [[nodiscard]] bool take_event(std::int64_t& now_ns) HAPTIC_RT;
    /// Takes the latencies of the next tick; false if there is none. For one other thread.
    [[nodiscard]] bool take_latencies(TickLatencies& latencies) HAPTIC_RT;
    /// Ticks whose latencies found the queue full. For any thread, at any time.
    [[nodiscard]] std::uint64_t lost_latencies() const HAPTIC_RT { return latencies_.dropped(); }

  private:
    /// Enters the tick into worst_, late_ and largest_; true if it entered one of them.
    [[nodiscard]] bool keep(const TimedTick& tick) HAPTIC_RT;
    /// Time (ns) that the thread has been runnable without its processor since it began; -1 if the kernel does not
    /// report it.
    [[nodiscard]] std::int64_t total_wait_ns() const HAPTIC_RT;

    std::int64_t break_ns_ = -1;  // -1: no tick breaks
    TimedTick broken_;
    std::atomic<bool> is_broken_{false};
    std::atomic<int> thread_{0};
    std::atomic<std::int64_t> deadline_ns_{-1};
    int schedstat_fd_ = -1;  // /proc/thread-self/schedstat; -1: not open
    ThreadUsage usage_;
    std::int64_t waited_ns_ = -1;
    std::array<TimedTick, kWorst> worst_{};
    std::size_t worst_count_ = 0;
    std::array<TimedTick, kLate> late_{};
    std::array<TimedTick, kLatencies> largest_{};
    std::uint64_t late_ticks_ = 0;
    std::uint64_t missed_ = 0;
    SpscQueue<std::int64_t> events_{256};
    SpscQueue<TickLatencies> latencies_{kQueued};
};

}  // namespace haptic::rt
