// Apart from motor_gate.cpp because it waits, which no tick may.
#include <ctime>

#include <haptic/clock.hpp>
#include "process/motor_gate.hpp"

namespace haptic::rt {
namespace {

constexpr long kLookNs = 100'000;

}  // namespace

void MotorGate::close() noexcept {
    zero_motors(monotonic_now_ns());
    if (!exchanging_.load()) {
        return;
    }
    // What is under way may still be going to send the tick's command. It never ends where its own thread is the one
    // that crashed, or where the board hangs.
    const std::int64_t end_ns = monotonic_now_ns() + kLongestWaitNs;
    while (exchanging_.load() && monotonic_now_ns() < end_ns) {
        const timespec look{0, kLookNs};
        nanosleep(&look, nullptr);
    }
    zero_motors(monotonic_now_ns());
}

}  // namespace haptic::rt
