#include "process/held_hand.hpp"

namespace haptic::rt {

void HeldHandBoard::release_if_running() HAPTIC_RT {
    if (tick_ != nullptr && tick_->safety_state() == SafetyState::Running) {
        board_->device().release_hand();
    }
}

device::ExchangeStatus HeldHandBoard::exchange(const device::MotorCommand& command, device::BoardReading& reading,
                                               std::int64_t now_ns) HAPTIC_RT {
    release_if_running();
    return board_->exchange(command, reading, now_ns);
}

device::ExchangeStatus HeldHandBoard::send(const device::MotorCommand& command, std::int64_t now_ns) HAPTIC_RT {
    release_if_running();
    return board_->send(command, now_ns);
}

}  // namespace haptic::rt
