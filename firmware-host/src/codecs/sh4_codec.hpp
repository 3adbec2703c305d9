// Codec of the Cyverse "USB2.0 SH4" board (0CEC:0205), both directions. Driver and emulated board use the same
// functions.
//
// One OUT packet of 512 bytes on endpoint 0x02 carries eight DAC codes. The board then latches all encoders and queues
// one IN packet of 512 bytes on endpoint 0x86. All words are little-endian.
//   OUT  0: 01 (update all)   1: 0E (base analyser)   2..17: 8 x u16 DAC codes   18..511: ignored
//   IN   0..15: 8 x u16 DAC codes as set   16..31: 8 x u16 raw counters   32..47: 8 x u16 A/D, 12 bit
//        48..49: PIO   50..53: u32 info, meaning unknown   54..511: unused
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

inline constexpr std::size_t kSh4PacketBytes = 512;

using Sh4Packet = std::array<std::byte, kSh4PacketBytes>;

struct Sh4Command {
    std::array<std::uint16_t, kStrings> dac_codes{};  // 0..4095

    friend bool operator==(const Sh4Command&, const Sh4Command&) = default;
};

struct Sh4Reply {
    std::array<std::uint16_t, kStrings> dac_codes{};  // echo
    std::array<std::uint16_t, kStrings> counters{};   // raw, wrapping
    std::array<std::uint16_t, kStrings> analog{};     // 12 bit
    std::uint16_t pio = 0;                            // bits 0-2 switches, 4-7 rotary switch
    std::uint32_t info = 0;

    friend bool operator==(const Sh4Reply&, const Sh4Reply&) = default;
};

/// The board counts with the opposite sign of the host: negation modulo 65536, both ways.
[[nodiscard]] inline std::uint32_t negated_counter(std::uint32_t counter) HAPTIC_RT {
    return (0U - counter) & 0xFFFFU;
}

/// Host side. DAC codes above kMaxDacCode are clamped; the rest of the packet is zero.
void encode(const Sh4Command& command, std::span<std::byte, kSh4PacketBytes> out) HAPTIC_RT;
[[nodiscard]] PacketDefect decode(std::span<const std::byte> in, Sh4Reply& reply) HAPTIC_RT;

/// Board side.
[[nodiscard]] PacketDefect decode(std::span<const std::byte> out, Sh4Command& command) HAPTIC_RT;
void encode(const Sh4Reply& reply, std::span<std::byte, kSh4PacketBytes> in) HAPTIC_RT;

}  // namespace haptic::device
