// Codec of the Cyverse "USB2.0 Simple" board (0CEC:0203), both directions. Driver and emulated board use the same
// functions.
//
// OUT packets of 32 bytes on endpoint 0x02, four kinds:
//   A2 1A mm           bit i of mm is the counting direction of encoder i
//   A2 19 mm           clears the counters whose bits are set
//   52 + 8 x u16 LE    DAC codes of all motors, bytes 1..16
//   51                 latches all encoders together and queues one IN packet
// IN packet of 32 bytes on endpoint 0x86:
//   0..23: 8 x 24-bit signed little-endian counters   24: PIO   25..31: unused
// @source device-facts, section 2.2.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "codecs/packet_defect.hpp"
#include "haptic/device/dac_codes.hpp"
#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"

namespace haptic::device {

inline constexpr std::size_t kSimplePacketBytes = 32;

using SimplePacket = std::array<std::byte, kSimplePacketBytes>;

enum class SimpleRequest : std::uint8_t {
    Phase,  // channels: counting direction
    Clear,  // channels: which counters
    DacCodes,
    Latch
};

struct SimpleCommand {
    SimpleRequest request = SimpleRequest::Latch;
    std::uint8_t channels = 0;                        // bit i: encoder i; Phase and Clear only
    std::array<std::uint16_t, kStrings> dac_codes{};  // 0..4095; DacCodes only

    friend bool operator==(const SimpleCommand&, const SimpleCommand&) = default;
};

struct SimpleReply {
    std::array<std::uint32_t, kStrings> counters{};  // modulo 2^24
    std::uint8_t pio = 0;                            // bits 0-2 switches, 4-7 rotary switch

    friend bool operator==(const SimpleReply&, const SimpleReply&) = default;
};

/// Host side. DAC codes above kMaxDacCode are clamped; unused bytes are zero.
void encode(const SimpleCommand& command, std::span<std::byte, kSimplePacketBytes> out) HAPTIC_RT;
[[nodiscard]] PacketDefect decode(std::span<const std::byte> in, SimpleReply& reply) HAPTIC_RT;

/// Board side. Counters are encoded modulo 2^24.
[[nodiscard]] PacketDefect decode(std::span<const std::byte> out, SimpleCommand& command) HAPTIC_RT;
void encode(const SimpleReply& reply, std::span<std::byte, kSimplePacketBytes> in) HAPTIC_RT;

}  // namespace haptic::device
