#include "process/motor_gate.hpp"

#include <ctime>

#include "haptic/clock.hpp"

namespace haptic::rt {
namespace {

constexpr long kPollNs = 100'000;

}  // namespace

template <class Call>
device::ExchangeStatus MotorGate::pass(const device::MotorCommand& command, std::int64_t now_ns,
                                       const Call& call) HAPTIC_RT {
    // Set exchanging_ before reading closed_: either this thread sees the gate closed, or close() sees the exchange.
    exchanging_.store(true);
    const bool was_cut = is_cut();
    const device::ExchangeStatus status = call(closed_.load() || was_cut ? device::MotorCommand{} : command);
    exchanging_.store(false);
    // The process may have stood still between the look at the flag and the command: then it came after the zeros.
    if (!was_cut && is_cut()) {
        board_->zero_motors(now_ns);
    }
    return status;
}

device::ExchangeStatus MotorGate::exchange(const device::MotorCommand& command, device::BoardReading& reading,
                                           std::int64_t now_ns) HAPTIC_RT {
    return pass(command, now_ns, [&](const device::MotorCommand& passed) HAPTIC_RT {
        return board_->exchange(passed, reading, now_ns);
    });
}

device::ExchangeStatus MotorGate::send(const device::MotorCommand& command, std::int64_t now_ns) HAPTIC_RT {
    return pass(command, now_ns,
                [&](const device::MotorCommand& passed) HAPTIC_RT { return board_->send(passed, now_ns); });
}

void MotorGate::zero_motors(std::int64_t now_ns) HAPTIC_RT {
    closed_.store(true);
    board_->zero_motors(now_ns);
}

void MotorGate::close() noexcept {
    // Replace all later commands by zeros, and send zeros now.
    zero_motors(monotonic_now_ns());
    if (!exchanging_.load()) {
        return;
    }
    // The exchange under way may still send the tick's command. The wait is bounded, because the exchange never ends if
    // its own thread crashed or the board hangs.
    const std::int64_t end_ns = monotonic_now_ns() + kLongestWaitNs;
    while (exchanging_.load() && monotonic_now_ns() < end_ns) {
        const timespec wait{0, kPollNs};
        nanosleep(&wait, nullptr);
    }
    // Override the command that the exchange may have sent.
    zero_motors(monotonic_now_ns());
}

}  // namespace haptic::rt
