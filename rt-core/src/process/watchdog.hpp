// Watchdog: a thread that polls whether ticks still complete, and sets the motors to zero when the loop hangs.
//
// It sleeps nearly all the time and needs microseconds per poll. Therefore it runs at one priority above the loop
// (where the kernel allows it) and on another processor if there is one, so that a loop that spins forever cannot
// starve it. It measures silence in its own timely polls, not by the clock: suspending and resuming the whole process
// (SIGSTOP, a debugger) does not count as silence of the loop.
//
// When the loop is silent:
//   after limit_ns (up to 1.25 of it)  the gate is closed and zeros are sent, again at each further poll; the tick, if
//   it
//                                      ever continues, is disarmed at once with HAPTIC_FAULT_WATCHDOG
//   if the loop ends after all         nothing more: the process ends in its normal way
//   grace_ns later                     last_resort: exits the process, even if its main thread hangs too
#pragma once

#include <pthread.h>

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>

#include "process/motor_gate.hpp"
#include "process/supervision.hpp"
#include "tick/tick.hpp"

namespace haptic::rt {

struct WatchdogSettings {
    std::int64_t limit_ns = 100'000'000;    // ns, longest time without a completed tick
    std::int64_t grace_ns = 5'000'000'000;  // ns, from firing until last_resort
    int priority = 81;                      // SCHED_FIFO; a refusal is ignored
    int loop_cpu = -1;                      // processor to avoid, as LoopSettings::cpu
    void (*last_resort)() = nullptr;        // nullptr: prints a line to standard error, then _exit(3)
};

class Watchdog {
  public:
    /// Starts polling at once; judges only while a loop runs the tick. Tick and gate must outlive the watchdog, which
    /// must outlive the loop. Throws std::system_error if the thread cannot be created.
    Watchdog(const WatchdogSettings& settings, Tick& tick, MotorGate& gate, const Supervision& supervision = {});
    Watchdog(const Watchdog&) = delete;
    Watchdog& operator=(const Watchdog&) = delete;
    /// Waits for the end of the current poll at most.
    ~Watchdog();

    /// True once zeros were sent.
    [[nodiscard]] bool fired() const noexcept { return fired_.load(); }
    /// SCHED_FIFO priority of its thread; 0: it was refused. Waits until the thread has asked.
    [[nodiscard]] int priority() const noexcept;

  private:
    static constexpr int kUnknown = -1;

    static void* thread_entry(void* self);
    void watch();
    [[nodiscard]] bool wait_until(std::int64_t time_ns);

    WatchdogSettings settings_;
    Tick* tick_;
    MotorGate* gate_;
    Supervision supervision_;
    std::atomic<int> priority_{kUnknown};
    std::atomic<bool> fired_{false};
    std::mutex mutex_;
    std::condition_variable stop_;
    bool stopping_ = false;  // guarded by mutex_
    pthread_t thread_{};
};

}  // namespace haptic::rt
