#include "process/motor_gate.hpp"

namespace haptic::rt {

device::ExchangeStatus MotorGate::exchange(const device::MotorCommand& command, device::BoardReading& reading,
                                           std::int64_t now_ns) HAPTIC_RT {
    exchanging_.store(true);
    const device::ExchangeStatus status =
        board_->exchange(closed_.load() ? device::MotorCommand{} : command, reading, now_ns);
    exchanging_.store(false);
    return status;
}

void MotorGate::zero_motors(std::int64_t now_ns) HAPTIC_RT {
    closed_.store(true);
    board_->zero_motors(now_ns);
}

}  // namespace haptic::rt
