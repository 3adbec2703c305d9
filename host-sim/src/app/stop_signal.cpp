#include "app/stop_signal.hpp"

#include <cerrno>
#include <ctime>

#include "haptic/types.hpp"

namespace haptic::sim {
namespace {

volatile std::sig_atomic_t requested = 0;

void request_stop(int /*signal*/) {
    requested = 1;
}

}  // namespace

StopOnSignal::StopOnSignal() {
    requested = 0;
    struct sigaction action{};
    action.sa_handler = request_stop;  // without SA_RESTART, so that a sleep ends at once
    (void)sigaction(SIGINT, &action, &old_interrupt_);
    (void)sigaction(SIGTERM, &action, &old_terminate_);
    (void)sigaction(SIGHUP, &action, &old_hangup_);
}

StopOnSignal::~StopOnSignal() {
    (void)sigaction(SIGINT, &old_interrupt_, nullptr);
    (void)sigaction(SIGTERM, &old_terminate_, nullptr);
    (void)sigaction(SIGHUP, &old_hangup_, nullptr);
}

bool stop_requested() noexcept {
    return requested != 0;
}

void sleep_until(std::int64_t time_ns) noexcept {
    const timespec deadline{static_cast<std::time_t>(time_ns / kNanosecondsPerSecond),
                            static_cast<long>(time_ns % kNanosecondsPerSecond)};
    while (requested == 0 && clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &deadline, nullptr) == EINTR) {
    }
}

}  // namespace haptic::sim
