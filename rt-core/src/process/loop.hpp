// The thread that runs ticks at absolute deadlines.
//
// Deadlines are start + k * period for all time. A tick that wakes late runs at once; deadlines that have passed by the
// time it is done are counted and skipped, so that the phase is kept and no burst of ticks makes up for lost ones.
#pragma once

#include <pthread.h>

#include <atomic>
#include <cstdint>
#include <future>
#include <memory>

#include <haptic/realtime.hpp>
#include "process/realtime_setup.hpp"
#include "tick/tick.hpp"
#include "tick/tick_syscalls.hpp"
#include "process/timing_log.hpp"

namespace haptic::rt {

struct LoopSettings {
    std::int64_t period_ns = 1'000'000;  // ns
    int priority = 80;                   // SCHED_FIFO, 1..97: the watchdog has the next one, the kernel's threads 99
    int cpu = -1;                        // -1: choose_cpu() of cpu_list.hpp
    int idle_exit_us = 0;                // us: of the idle states that are allowed meanwhile; -1: as it is
    int warm_up_ticks = 200;             // disarmed, before measuring begins: caches, branch predictors and pages
};

/// The deadline after one at which a tick has just ended at now_ns, and how many were skipped to get there.
struct NextDeadline {
    std::int64_t deadline_ns;
    std::int64_t missed;
};
[[nodiscard]] NextDeadline next_deadline(std::int64_t deadline_ns, std::int64_t period_ns,
                                         std::int64_t now_ns) HAPTIC_RT;

/// Owns the real-time thread. Use: construct, look at setup(), start(), wait until finished(), join().
class RealtimeLoop {
  public:
    /// Creates the thread and lets it prepare itself; it then waits for start(). `setup` is that of prepare_process().
    /// Throws std::system_error if there is no thread to be had.
    RealtimeLoop(const LoopSettings& settings, Tick& tick, RealtimeSetup setup);
    RealtimeLoop(const RealtimeLoop&) = delete;
    RealtimeLoop& operator=(const RealtimeLoop&) = delete;
    /// Stops in an orderly way and joins.
    ~RealtimeLoop();

    [[nodiscard]] const RealtimeSetup& setup() const noexcept { return setup_; }
    /// Warms up, which is not measured, arms, runs until a stop or a fault has been seen through to the disarmed state.
    /// Each tick, those of the warm-up too, is also kept in the recorder, if there is one; each that is measured in the
    /// log, if there is one. Both must outlive the loop.
    void start(Recorder* recorder = nullptr, TimingLog* log = nullptr);
    /// From any thread, any number of times. The force fades, then the tension, then the loop ends.
    void request_stop() noexcept { stop_requested_.store(true, std::memory_order_relaxed); }
    /// True once no tick will run any more; the tick's records may then be read.
    [[nodiscard]] bool finished() const noexcept { return finished_.load(std::memory_order_acquire); }
    /// Of the last tick.
    [[nodiscard]] SafetyState safety_state() const noexcept { return state_.load(std::memory_order_relaxed); }
    void join();

    /// What the kernel counted of the thread from the end of the warm-up to the end; after finished().
    [[nodiscard]] ThreadUsage usage() const noexcept { return usage_; }

  private:
    static void* thread_entry(void* self);
    void cycle() HAPTIC_RT;
    void warm_up(std::int64_t& deadline_ns) HAPTIC_RT;
    [[nodiscard]] std::int64_t run_one(std::int64_t deadline_ns, std::int64_t missed) HAPTIC_RT;

    LoopSettings settings_;
    Tick* tick_;
    RealtimeSetup setup_;
    std::unique_ptr<const Instruments> measured_;  // by the tick before this loop
    Recorder* recorder_ = nullptr;
    TimingLog* log_ = nullptr;
    ThreadUsage usage_;
    std::promise<void> prepared_;
    std::promise<bool> go_;
    bool started_ = false;
    bool joined_ = false;
    std::atomic<bool> stop_requested_{false};
    std::atomic<bool> finished_{false};
    std::atomic<SafetyState> state_{SafetyState::Disarmed};
    pthread_t thread_{};
};

}  // namespace haptic::rt
