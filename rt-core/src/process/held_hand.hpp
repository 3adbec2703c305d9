// An emulated hand that waits at the centre until the loop runs, as a person does.
#pragma once

#include <cstdint>

#include <haptic/device/emulated_board.hpp>
#include <haptic/realtime.hpp>
#include "tick/tick.hpp"

namespace haptic::rt {

/// Stands between a tick and an emulated board, and releases the board's waiting hand once the tick is running.
/// Calibration then always finds the hand where its track begins.
class HeldHandBoard final : public device::Board {
  public:
    explicit HeldHandBoard(device::EmulatedBoard& board) : board_(&board) {}
    /// The tick whose state releases the hand; the same thread runs both.
    void follow(const Tick& tick) noexcept { tick_ = &tick; }

    void start() override { board_->start(); }
    device::ExchangeStatus exchange(const device::MotorCommand& command, device::BoardReading& reading,
                                    std::int64_t now_ns) HAPTIC_RT override;
    void zero_motors(std::int64_t now_ns) HAPTIC_RT override { board_->zero_motors(now_ns); }

  private:
    device::EmulatedBoard* board_;
    const Tick* tick_ = nullptr;
};

}  // namespace haptic::rt
