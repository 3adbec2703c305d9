// Emulated board: a complete Spidar-G6 in this process. The driver of a board exchanges encoded packets with the
// board's emulated firmware, which has an emulated device and hand behind it.
#pragma once

#include <cstdint>
#include <memory>

#include "haptic/device/board.hpp"
#include "haptic/device/board_options.hpp"
#include "haptic/device/emulated_device.hpp"

namespace haptic::device {

class Firmware;
class Transport;

class EmulatedBoard final : public Board {
  public:
    using Settings = EmulatedDevice::Settings;

    /// The board is started on return. Throws std::invalid_argument for settings that cannot be emulated.
    explicit EmulatedBoard(Settings settings, const BoardOptions& options = {});
    EmulatedBoard(const EmulatedBoard&) = delete;
    EmulatedBoard& operator=(const EmulatedBoard&) = delete;
    ~EmulatedBoard() override;

    void start() override { board_->start(); }
    ExchangeStatus exchange(const MotorCommand& command, BoardReading& reading,
                            std::int64_t now_ns) HAPTIC_RT override {
        return board_->exchange(command, reading, now_ns);
    }
    ExchangeStatus send(const MotorCommand& command, std::int64_t now_ns) HAPTIC_RT override {
        return board_->send(command, now_ns);
    }
    [[nodiscard]] bool answer_due() const HAPTIC_RT override { return board_->answer_due(); }
    ExchangeStatus collect(std::int64_t now_ns) HAPTIC_RT override { return board_->collect(now_ns); }
    void zero_motors(std::int64_t now_ns) HAPTIC_RT override { board_->zero_motors(now_ns); }

    /// Grip, hand, strings and motors.
    [[nodiscard]] EmulatedDevice& device() HAPTIC_RT { return device_; }
    [[nodiscard]] const EmulatedDevice& device() const HAPTIC_RT { return device_; }

  private:
    EmulatedDevice device_;
    std::unique_ptr<Firmware> firmware_;
    std::unique_ptr<Transport> transport_;
    std::unique_ptr<Board> board_;
};

}  // namespace haptic::device
