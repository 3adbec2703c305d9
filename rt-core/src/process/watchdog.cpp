#include "process/watchdog.hpp"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <system_error>

#include <haptic/clock.hpp>
#include "process/crash_guard.hpp"
#include "process/realtime_setup.hpp"

namespace haptic::rt {
namespace {

constexpr int kExitStatus = 3;  // the run ended in a fault
constexpr std::int64_t kShortestLookNs = 1'000'000;
constexpr const char* kMessage = "rt-core: watchdog: the loop hangs and so does the process; leaving it\n";

void leave() {
    // Nothing but this: whatever else the process was doing has not come to its end either.
    [[maybe_unused]] const ssize_t written = write(STDERR_FILENO, kMessage, std::strlen(kMessage));
    _exit(kExitStatus);
}

}  // namespace

Watchdog::Watchdog(const WatchdogSettings& settings, Tick& tick, MotorGate& gate)
    : settings_(settings), tick_(&tick), gate_(&gate) {
    pthread_attr_t attributes;
    int error = pthread_attr_init(&attributes);
    if (error == 0) {
        error = pthread_attr_setstacksize(&attributes, kSideStackBytes);
        error = error == 0 ? pthread_create(&thread_, &attributes, &Watchdog::thread_entry, this) : error;
        pthread_attr_destroy(&attributes);
    }
    if (error != 0) {
        throw std::system_error(error, std::system_category(), "creating the watchdog's thread");
    }
}

Watchdog::~Watchdog() {
    {
        const std::lock_guard lock(mutex_);
        stopping_ = true;
    }
    stop_.notify_one();
    pthread_join(thread_, nullptr);
}

void* Watchdog::thread_entry(void* self) {
    const AlternateSignalStack signal_stack;
    auto* const watchdog = static_cast<Watchdog*>(self);
    prepare_side_thread(watchdog->settings_.priority, watchdog->settings_.loop_cpu);
    watchdog->watch();
    return nullptr;
}

/// False once the watchdog is to end.
bool Watchdog::wait_until(std::int64_t time_ns) {
    // steady_clock is CLOCK_MONOTONIC.
    const std::chrono::steady_clock::time_point time{std::chrono::nanoseconds(time_ns)};
    std::unique_lock lock(mutex_);
    return !stop_.wait_until(lock, time, [this] { return stopping_; });
}

void Watchdog::watch() {
    const std::int64_t look_ns = std::max(settings_.limit_ns / SilenceJudge::kLooks, kShortestLookNs);
    SilenceJudge judge;
    std::int64_t due_ns = monotonic_now_ns() + look_ns;
    std::int64_t fired_ns = 0;
    while (wait_until(due_ns)) {
        const std::int64_t now_ns = monotonic_now_ns();
        const bool late = now_ns - due_ns >= look_ns;
        due_ns = now_ns + look_ns;
        const std::uint64_t beats = tick_->heart().beats();
        const bool dead = judge.dead(beats, late);
        if (fired_ns == 0) {
            if (!dead) {
                continue;
            }
            fired_ns = now_ns;
            tick_->cut(HAPTIC_FAULT_WATCHDOG);
            gate_->close();
            fired_.store(true);
        } else if (beats != 0) {
            gate_->close();  // the command that was under way may have come through since
            if (now_ns - fired_ns >= settings_.grace_ns) {
                (settings_.last_resort != nullptr ? settings_.last_resort : &leave)();
            }
        }
    }
}

}  // namespace haptic::rt
