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
#include <optional>

#include "haptic/realtime.hpp"
#include "process/arm_switch.hpp"
#include "process/realtime_setup.hpp"
#include "process/supervision.hpp"
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
    int arm_button = -1;                 // switch of the board that arms when it is held; -1: none
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
    /// The loop beats in `page`, and stops if that says so; nullptr: none. Throws std::system_error if the thread
    /// cannot be created.
    RealtimeLoop(const LoopSettings& settings, Tick& tick, RealtimeSetup setup, SupervisionPage* page = nullptr);
    RealtimeLoop(const RealtimeLoop&) = delete;
    RealtimeLoop& operator=(const RealtimeLoop&) = delete;
    /// Stops the loop in an orderly way and joins the thread.
    ~RealtimeLoop();

    [[nodiscard]] const RealtimeSetup& setup() const noexcept { return setup_; }
    /// Starts the loop: warms up, arms the tick, and runs until a stop or a fault has led to the disarmed state. With
    /// an arm switch it runs disarmed after the warm-up until a person acts. The recorder gets every tick, the log
    /// every measured one, which excludes those before arming; nullptr: none. All must outlive the loop.
    void start(Recorder* recorder = nullptr, TimingLog* log = nullptr, ArmSwitch* person = nullptr);
    /// Requests a stop; from any thread, any number of times. The force fades out, then the tension, then the loop
    /// ends.
    void request_stop() noexcept { stop_requested_.store(true, std::memory_order_relaxed); }
    /// True once no further tick will run; the tick's records may then be read.
    [[nodiscard]] bool finished() const noexcept { return finished_.load(std::memory_order_acquire); }
    /// Flags HAPTIC_TICK_* of the last tick.
    [[nodiscard]] std::uint32_t flags() const noexcept { return flags_.load(std::memory_order_relaxed); }
    /// Safety state after the last tick.
    [[nodiscard]] SafetyState safety_state() const noexcept { return state_.load(std::memory_order_relaxed); }
    void join();

    /// Why the loop ended while it was still disarmed: how the exchanges failed. Valid after finished().
    [[nodiscard]] std::optional<device::ExchangeStatus> lost() const noexcept { return lost_; }

    /// The kernel's counters of the thread from arming to the end; valid after finished().
    [[nodiscard]] ThreadUsage usage() const noexcept { return usage_; }

  private:
    static void* thread_entry(void* self);
    void cycle() HAPTIC_RT;
    void warm_up(std::int64_t& deadline_ns) HAPTIC_RT;
    /// Runs disarmed until a person acts, a stop is requested, or the device is lost.
    void await_person(NextDeadline& next) HAPTIC_RT;
    /// Arms the tick, and runs until it is disarmed again.
    void run_armed(NextDeadline& next) HAPTIC_RT;
    [[nodiscard]] std::int64_t run_one(std::int64_t deadline_ns, std::int64_t missed) HAPTIC_RT;
    void obey_supervisors(std::int64_t now_ns) HAPTIC_RT;

    LoopSettings settings_;
    Tick* tick_;
    RealtimeSetup setup_;
    SupervisionPage* page_;
    std::unique_ptr<Instruments> measured_;  // of the tick before this loop, restored after the warm-up
    Recorder* recorder_ = nullptr;
    TimingLog* log_ = nullptr;
    ArmSwitch* person_ = nullptr;  // nullptr: arms by itself
    std::optional<device::ExchangeStatus> lost_;
    ThreadUsage usage_;
    std::promise<void> prepared_;
    std::promise<bool> go_;
    bool started_ = false;
    bool joined_ = false;
    std::atomic<bool> stop_requested_{false};
    std::atomic<bool> finished_{false};
    std::atomic<SafetyState> state_{SafetyState::Disarmed};
    std::atomic<std::uint32_t> flags_{0};
    pthread_t thread_{};
};

}  // namespace haptic::rt
