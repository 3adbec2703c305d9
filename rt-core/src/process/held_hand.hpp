// Held hand: keeps the emulated hand at the centre until the loop is running, as a person would.
#pragma once

#include <cstdint>

#include "haptic/device/emulated_board.hpp"
#include "haptic/realtime.hpp"
#include "tick/tick.hpp"

namespace haptic::rt {

/// Board decorator between a tick and an emulated board; releases the board's waiting hand once the tick is Running, so
/// that calibration always finds the hand at the start of its track.
class HeldHandBoard final : public device::Board {
  public:
    explicit HeldHandBoard(device::EmulatedBoard& board) : board_(&board) {}
    /// Sets the tick whose state releases the hand; the thread of that tick must also run the exchanges.
    void attach(const Tick& tick) noexcept { tick_ = &tick; }

    void start() override { board_->start(); }
    device::ExchangeStatus exchange(const device::MotorCommand& command, device::BoardReading& reading,
                                    std::int64_t now_ns) HAPTIC_RT override;
    device::ExchangeStatus send(const device::MotorCommand& command, std::int64_t now_ns) HAPTIC_RT override;
    [[nodiscard]] bool answer_due() const HAPTIC_RT override { return board_->answer_due(); }
    device::ExchangeStatus collect(std::int64_t now_ns) HAPTIC_RT override { return board_->collect(now_ns); }
    void zero_motors(std::int64_t now_ns) HAPTIC_RT override { board_->zero_motors(now_ns); }

  private:
    void release_if_running() HAPTIC_RT;

    device::EmulatedBoard* board_;
    const Tick* tick_ = nullptr;
};

}  // namespace haptic::rt
