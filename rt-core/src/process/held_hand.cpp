#include "process/held_hand.hpp"

namespace haptic::rt {

device::ExchangeStatus HeldHandBoard::exchange(const device::MotorCommand& command, device::BoardReading& reading,
                                               std::int64_t now_ns) HAPTIC_RT {
    if (tick_ != nullptr && tick_->safety_state() == SafetyState::Running) {
        board_->device().release_hand();
    }
    return board_->exchange(command, reading, now_ns);
}

}  // namespace haptic::rt
