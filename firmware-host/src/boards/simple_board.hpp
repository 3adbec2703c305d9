// The Cyverse "USB2.0 Simple" board (0CEC:0203), both ends: how a host drives it, and its firmware hosted on Linux.
#pragma once

#include <cstdint>

#include <haptic/device/board.hpp>
#include <haptic/device/emulated_device.hpp>
#include "emulated/firmware.hpp"
#include "emulated/reply_queue.hpp"
#include "codecs/simple_codec.hpp"
#include "transport/transport.hpp"

namespace haptic::device {

/// Host side. An exchange is three transfers: digits, latch, answer. Nothing in an answer tells to which command it
/// belongs, so that after an answer that did not come in time the next exchange first fetches what may still come:
/// an exchange takes at most twice the transport's bound.
class SimpleBoard final : public Board {
  public:
    /// The transport must outlive the board. `phase`: bit i is the counting direction of encoder i; which of its values
    /// counts in a variant's sense is not known for certain, 0xFF is what published drivers send.
    explicit SimpleBoard(Transport& transport, std::uint8_t phase = 0xFF) : transport_(&transport), phase_(phase) {}

    /// Counting directions, then counters to zero.
    void start() override;
    ExchangeStatus exchange(const MotorCommand& command, BoardReading& reading, std::int64_t now_ns) HAPTIC_RT override;
    void zero_motors(std::int64_t now_ns) HAPTIC_RT override;

  private:
    Transport* transport_;
    std::uint8_t phase_;
    bool owed_ = false;  // an answer did not come in time
    SimplePacket digits_{};
    SimplePacket latch_{};
    SimplePacket in_{};
};

/// Board side. A packet of another length or opcode, or with a digit above 12 bits, is not answered and changes
/// nothing. Until it is told the counting directions it counts against the host's sense, so that a driver which forgets
/// to is found out.
class SimpleFirmware final : public Firmware {
  public:
    /// The device must outlive its firmware.
    explicit SimpleFirmware(EmulatedDevice& device);

    void receive(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT override;
    std::size_t reply(std::span<std::byte> in, std::int64_t now_ns) HAPTIC_RT override;

  private:
    using Counters = std::array<std::uint32_t, kStrings>;
    [[nodiscard]] Counters counters() const HAPTIC_RT;
    /// The counters go on from these values.
    void set_counters(const Counters& counters) HAPTIC_RT;

    EmulatedDevice* device_;
    Counters base_{};    // of this board's counters
    Counters origin_{};  // of the device's encoders, where the board's counters were base_
    std::uint8_t phase_ = 0;
    ReplyQueue<kSimplePacketBytes> replies_;
};

}  // namespace haptic::device
