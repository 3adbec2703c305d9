#include "process/watchdog.hpp"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstring>

#include "haptic/clock.hpp"
#include "process/crash_guard.hpp"
#include "process/realtime_setup.hpp"

namespace haptic::rt {
namespace {

constexpr int kExitStatus = 3;  // the run ended in a fault
constexpr std::int64_t kMinPollNs = 1'000'000;
constexpr const char* kMessage = "rt-core: watchdog: the loop and the process hang; exiting\n";

void leave() {
    // No cleanup, because the rest of the process hangs too. A standard error that takes no line now would block.
    pollfd watched{STDERR_FILENO, POLLOUT, 0};
    if (poll(&watched, 1, 0) == 1) {
        [[maybe_unused]] const ssize_t written = write(STDERR_FILENO, kMessage, std::strlen(kMessage));
    }
    _exit(kExitStatus);
}

}  // namespace

Watchdog::Watchdog(const WatchdogSettings& settings, Tick& tick, MotorGate& gate, const Supervision& supervision)
    : settings_(settings), tick_(&tick), gate_(&gate), supervision_(supervision) {
    thread_ = create_thread(&Watchdog::thread_entry, this, kSideStackBytes, "creating the watchdog's thread");
}

Watchdog::~Watchdog() {
    {
        const std::lock_guard lock(mutex_);
        stopping_ = true;
    }
    stop_.notify_one();
    pthread_join(thread_, nullptr);
    if (supervision_.page != nullptr) {
        supervision_.page->leave(Supervisor::Watchdog);
    }
}

int Watchdog::priority() const noexcept {
    priority_.wait(kUnknown);
    return priority_.load();
}

void* Watchdog::thread_entry(void* self) {
    const AlternateSignalStack signal_stack;
    auto* const watchdog = static_cast<Watchdog*>(self);
    watchdog->priority_.store(prepare_side_thread(watchdog->settings_.priority, watchdog->settings_.loop_cpu));
    watchdog->priority_.notify_all();
    watchdog->watch();
    return nullptr;
}

/// Sleeps until an absolute time; returns false if the watchdog is to end.
bool Watchdog::wait_until(std::int64_t time_ns) {
    // steady_clock is CLOCK_MONOTONIC.
    const std::chrono::steady_clock::time_point time{std::chrono::nanoseconds(time_ns)};
    std::unique_lock lock(mutex_);
    return !stop_.wait_until(lock, time, [this] { return stopping_; });
}

void Watchdog::watch() {
    // Several polls within the limit, so that a single late one cannot fire the watchdog.
    const std::int64_t poll_ns = std::max(settings_.limit_ns / StallDetector::kChecks, kMinPollNs);
    StallDetector detector;
    SupervisorCheck others(supervision_, Supervisor::Watchdog);
    std::int64_t due_ns = monotonic_now_ns() + poll_ns;
    std::int64_t fired_ns = 0;
    while (wait_until(due_ns)) {
        const std::int64_t now_ns = monotonic_now_ns();
        // A late poll means that this process was suspended too, so it does not count as silence of the loop.
        const bool late = now_ns - due_ns >= poll_ns;
        due_ns = now_ns + poll_ns;
        if (supervision_.page != nullptr) {
            supervision_.page->beat(Supervisor::Watchdog);
            others.check(now_ns);
        }
        // The loop is dead after kChecks polls in a row without a heartbeat.
        const std::uint64_t beats = tick_->heart().beats();
        const bool dead = detector.stalled(beats, late);
        if (fired_ns == 0) {
            if (!dead) {
                continue;
            }
            // Disarm the tick, and set the motors to zero.
            fired_ns = now_ns;
            tick_->cut(HAPTIC_FAULT_WATCHDOG);
            gate_->close();
            fired_.store(true);
        } else if (beats != 0) {
            // Motors are at zero. Leave the process if the loop does not end within the grace period.
            gate_->close();  // overrides a command that was under way at the first close()
            if (now_ns - fired_ns >= settings_.grace_ns) {
                (settings_.last_resort != nullptr ? settings_.last_resort : &leave)();
            }
        }
    }
}

}  // namespace haptic::rt
