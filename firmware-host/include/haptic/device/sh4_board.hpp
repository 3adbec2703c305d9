// The Cyverse "USB2.0 SH4" board (0CEC:0205), both ends: how a host drives it, and its firmware hosted on Linux.
#pragma once

#include <cstdint>

#include "haptic/device/board.hpp"
#include "haptic/device/emulated_device.hpp"
#include "haptic/device/firmware.hpp"
#include "haptic/device/sh4_codec.hpp"
#include "haptic/device/transport.hpp"

namespace haptic::device {

/// Host side. Counters come negated and modulo 65536: the host's count is the negated raw one.
class Sh4Board final : public Board {
  public:
    /// The transport must outlive the board.
    explicit Sh4Board(Transport& transport) : transport_(&transport) {}

    ExchangeStatus exchange(const MotorCommand& command, BoardReading& reading, std::int64_t now_ns) HAPTIC_RT override;
    void zero_motors(std::int64_t now_ns) HAPTIC_RT override;

  private:
    Transport* transport_;
    Sh4Packet out_{};
    Sh4Packet in_{};
};

/// Board side. Answers each well-formed command with one reply; a packet of another length or opcode, or with a digit
/// above 12 bits, is not answered and changes nothing.
class Sh4Firmware final : public Firmware {
  public:
    /// The device must outlive its firmware.
    explicit Sh4Firmware(EmulatedDevice& device) : device_(&device) {}

    void receive(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT override;
    std::size_t reply(std::span<std::byte> in, std::int64_t now_ns) HAPTIC_RT override;

  private:
    EmulatedDevice* device_;
    Sh4Packet waiting_{};
    bool has_reply_ = false;
};

}  // namespace haptic::device
