#include "haptic/rt/held_hand.hpp"

namespace haptic::rt {

device::ExchangeStatus HeldHandBoard::exchange(const device::Sh4Packet& out, device::Sh4Packet& in,
                                               std::int64_t now_ns) HAPTIC_RT {
    released_ = released_ || (tick_ != nullptr && tick_->safety_state() == SafetyState::Running);
    if (started_ && !released_) {
        held_ns_ += now_ns - last_ns_;
    }
    started_ = true;
    last_ns_ = now_ns;
    return board_->exchange(out, in, now_ns - held_ns_);
}

}  // namespace haptic::rt
