// The Cyverse "USB2.0 SH4" board (0CEC:0205), both ends: how a host drives it, and its firmware hosted on Linux.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include <haptic/device/board.hpp>
#include <haptic/device/emulated_device.hpp>
#include "emulated/firmware.hpp"
#include "emulated/reply_queue.hpp"
#include "codecs/sh4_codec.hpp"
#include "transport/transport.hpp"

namespace haptic::device {

/// Host side. Counters come negated and modulo 65536: the host's count is the negated raw one.
///
/// With check_echo an answer that repeats the digits of one of the last commands but not of this one is Stale; the
/// exchange then fetches one more answer, so that a host which fell behind by a packet catches up at once, and by more
/// in as many exchanges. It takes at most twice the transport's bound. What was missed does not show while the digits
/// do not change; the counters are then those of the exchange before.
///
/// Without, nothing in an answer tells to which command it belongs, so that after one that did not come in time the
/// next exchange first fetches what may still come.
class Sh4Board final : public Board {
  public:
    /// The transport must outlive the board.
    explicit Sh4Board(Transport& transport, bool check_echo = true) : transport_(&transport), check_echo_(check_echo) {}

    /// Throws away answers to an earlier session. The board knows no start-up packets, and its counters stay.
    void start() override;
    ExchangeStatus exchange(const MotorCommand& command, BoardReading& reading, std::int64_t now_ns) HAPTIC_RT override;
    void zero_motors(std::int64_t now_ns) HAPTIC_RT override;

  private:
    using Digits = std::array<std::uint16_t, kStrings>;
    /// One answer, after sending `out` if it is not empty.
    ExchangeStatus fetch(std::span<const std::byte> out, Sh4Reply& reply, std::int64_t now_ns) HAPTIC_RT;
    /// Whether these are the digits of one of the last commands.
    [[nodiscard]] bool sent_lately(const Digits& digits) const HAPTIC_RT;

    static constexpr std::size_t kRemembered = 4;  // as many packets as wait at an endpoint

    Transport* transport_;
    bool check_echo_;
    bool owed_ = false;  // an answer did not come in time
    std::array<Digits, kRemembered> sent_{};
    std::size_t next_ = 0;  // place in sent_ of the next command
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
    ReplyQueue<kSh4PacketBytes> replies_;
};

}  // namespace haptic::device
