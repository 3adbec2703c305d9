// Zeros to the motors when the loop hangs: a thread of its own that looks whether ticks still end.
//
// It sleeps nearly always, and takes microseconds when it does not, so it may and does run above the loop (one priority
// higher, where the kernel allows that) and on another processor if there is one: a loop that spins for ever cannot
// keep it from running. It measures silence in looks of its own that came in time, not by the clock, so that stopping
// the whole process (SIGSTOP, a debugger) for however long and letting it go on is no silence of the loop.
//
// What happens when the loop is silent:
//   after the limit (to 1.25 of it)    the gate is closed and zeros are sent, again at each further look; the tick, if
//                                      it ever goes on, is disarmed at once, with HAPTIC_FAULT_WATCHDOG
//   when the loop has ended after all  nothing more: the process ends in its normal way
//   a grace later                      last_resort: the process is left even if its main thread hangs too
#pragma once

#include <pthread.h>

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>

#include "process/motor_gate.hpp"
#include "tick/tick.hpp"

namespace haptic::rt {

struct WatchdogSettings {
    std::int64_t limit_ns = 100'000'000;    // ns, without the end of a tick
    std::int64_t grace_ns = 5'000'000'000;  // ns, from then until last_resort
    int priority = 81;                      // SCHED_FIFO; goes on without where that is refused
    int loop_cpu = -1;                      // processor to keep away from, as LoopSettings::cpu
    void (*last_resort)() = nullptr;        // nullptr: a line to standard error, then _exit(3)
};

class Watchdog {
  public:
    /// Starts to look at once; judges only while the tick's heart beats, or has begun to. Tick and gate must outlive
    /// it, and it must outlive the loop. Throws std::system_error if there is no thread to be had.
    Watchdog(const WatchdogSettings& settings, Tick& tick, MotorGate& gate);
    Watchdog(const Watchdog&) = delete;
    Watchdog& operator=(const Watchdog&) = delete;
    /// Waits for nothing but the end of a look.
    ~Watchdog();

    /// Zeros were sent.
    [[nodiscard]] bool fired() const noexcept { return fired_.load(); }

  private:
    static void* thread_entry(void* self);
    void watch();
    [[nodiscard]] bool wait_until(std::int64_t time_ns);

    WatchdogSettings settings_;
    Tick* tick_;
    MotorGate* gate_;
    std::atomic<bool> fired_{false};
    std::mutex mutex_;
    std::condition_variable stop_;
    bool stopping_ = false;  // under the mutex
    pthread_t thread_{};
};

}  // namespace haptic::rt
