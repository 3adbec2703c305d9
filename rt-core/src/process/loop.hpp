// Real-time loop: the thread that runs ticks at absolute deadlines, start + k * period.
//
// A tick that wakes late runs at once. Deadlines that have passed by its end are counted and skipped, so that the phase
// is kept and no burst of ticks makes up for lost ones.
#pragma once

#include <pthread.h>

#include <atomic>
#include <cstdint>
#include <future>
#include <memory>

#include "haptic/realtime.hpp"
#include "process/realtime_setup.hpp"
#include "process/timing_log.hpp"
#include "tick/tick.hpp"
#include "tick/tick_syscalls.hpp"

namespace haptic::rt {

struct LoopSettings {
    std::int64_t period_ns = 1'000'000;  // ns
    int priority = 80;                   // SCHED_FIFO, 1..97: the watchdog uses priority + 1, kernel threads 99
    int cpu = -1;                        // -1: choose_cpu() of cpu_list.hpp
    int idle_exit_us = 0;                // us, allowed exit latency of idle states; -1: no request
    int warm_up_ticks = 200;             // disarmed and not measured; warm caches, branch predictors and pages
};

/// The first deadline after both deadline_ns and now_ns, the end of its tick, and the number of deadlines skipped.
struct NextDeadline {
    std::int64_t deadline_ns;
    std::int64_t missed;
};
[[nodiscard]] NextDeadline next_deadline(std::int64_t deadline_ns, std::int64_t period_ns,
                                         std::int64_t now_ns) HAPTIC_RT;

/// Owner of the real-time thread. Use: construct, check setup(), start(), wait until finished(), join().
class RealtimeLoop {
  public:
    /// Creates the thread, which prepares itself and then waits for start(). `setup` comes from prepare_process().
    /// Throws std::system_error if the thread cannot be created.
    RealtimeLoop(const LoopSettings& settings, Tick& tick, RealtimeSetup setup);
    RealtimeLoop(const RealtimeLoop&) = delete;
    RealtimeLoop& operator=(const RealtimeLoop&) = delete;
    /// Stops the loop in an orderly way and joins the thread.
    ~RealtimeLoop();

    [[nodiscard]] const RealtimeSetup& setup() const noexcept { return setup_; }
    /// Starts the loop: warms up, arms the tick, and runs until a stop or a fault has led to the disarmed state. The
    /// recorder gets every tick, the log every measured one, which excludes the warm-up; nullptr: none. Both must
    /// outlive the loop.
    void start(Recorder* recorder = nullptr, TimingLog* log = nullptr);
    /// Requests a stop; from any thread, any number of times. The force fades out, then the tension, then the loop
    /// ends.
    void request_stop() noexcept { stop_requested_.store(true, std::memory_order_relaxed); }
    /// True once no further tick will run; the tick's records may then be read.
    [[nodiscard]] bool finished() const noexcept { return finished_.load(std::memory_order_acquire); }
    /// Safety state after the last tick.
    [[nodiscard]] SafetyState safety_state() const noexcept { return state_.load(std::memory_order_relaxed); }
    void join();

    /// The kernel's counters of the thread from the end of the warm-up to the end; valid after finished().
    [[nodiscard]] ThreadUsage usage() const noexcept { return usage_; }

  private:
    static void* thread_entry(void* self);
    void cycle() HAPTIC_RT;
    void warm_up(std::int64_t& deadline_ns) HAPTIC_RT;
    [[nodiscard]] std::int64_t run_one(std::int64_t deadline_ns, std::int64_t missed) HAPTIC_RT;

    LoopSettings settings_;
    Tick* tick_;
    RealtimeSetup setup_;
    std::unique_ptr<const Instruments>
        measured_;  // instruments of the tick before this loop, restored after the warm-up
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
