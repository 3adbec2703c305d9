// A whole emulated Spidar-G6 in this process: the driver of a board, and at the other end of its packets the board's
// firmware with device and hand behind it. Packets are encoded and decoded as on the cable.
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "haptic/device/board.hpp"
#include "haptic/device/board_options.hpp"
#include "haptic/device/emulated_device.hpp"
#include "emulated/firmware.hpp"
#include "transport/transport.hpp"

namespace haptic::device {

/// Packets to a firmware in this process, and its answers back.
class EmulatedTransport final : public Transport {
  public:
    /// The firmware must outlive the transport.
    explicit EmulatedTransport(Firmware& firmware) : firmware_(&firmware) {}

    ExchangeStatus exchange(PacketExchange& packets, std::int64_t now_ns) HAPTIC_RT override;
    void send_last(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT override;
    void drain() override;

  private:
    Firmware* firmware_;
};

/// The firmware of a kind of board, in front of a device that outlives it; behind a faulty cable if the device's
/// settings want faults of packets.
[[nodiscard]] std::unique_ptr<Firmware> make_firmware(BoardKind kind, EmulatedDevice& device);
/// The driver of a kind of board, over a transport that outlives it.
[[nodiscard]] std::unique_ptr<Board> make_board(BoardKind kind, Transport& transport, const BoardOptions& options = {});

class EmulatedBoard final : public Board {
  public:
    using Settings = EmulatedDevice::Settings;

    /// A board that is started. Throws std::invalid_argument for settings that cannot be emulated.
    explicit EmulatedBoard(Settings settings, const BoardOptions& options = {});
    EmulatedBoard(const EmulatedBoard&) = delete;
    EmulatedBoard& operator=(const EmulatedBoard&) = delete;

    void start() override { board_->start(); }
    ExchangeStatus exchange(const MotorCommand& command, BoardReading& reading,
                            std::int64_t now_ns) HAPTIC_RT override {
        return board_->exchange(command, reading, now_ns);
    }
    void zero_motors(std::int64_t now_ns) HAPTIC_RT override { board_->zero_motors(now_ns); }

    /// Grip, hand, strings and motors.
    [[nodiscard]] EmulatedDevice& device() HAPTIC_RT { return device_; }
    [[nodiscard]] const EmulatedDevice& device() const HAPTIC_RT { return device_; }

  private:
    EmulatedDevice device_;
    std::unique_ptr<Firmware> firmware_;
    EmulatedTransport transport_;
    std::unique_ptr<Board> board_;
};

}  // namespace haptic::device
