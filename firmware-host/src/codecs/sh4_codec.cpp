#include "codecs/sh4_codec.hpp"

#include <algorithm>

#include "codecs/packet_bytes.hpp"

namespace haptic::device {
namespace {

constexpr std::byte kUpdateAll{0x01};
constexpr std::byte kBaseAnalyser{0x0E};

// Offsets in the OUT packet.
constexpr std::size_t kOutDacCodes = 2;
// Offsets in the IN packet.
constexpr std::size_t kInDacCodes = 0;
constexpr std::size_t kInCounters = 16;
constexpr std::size_t kInAnalog = 32;
constexpr std::size_t kInPio = 48;
constexpr std::size_t kInInfo = 50;

using Words = std::array<std::uint16_t, kStrings>;

void load_words(std::span<const std::byte> bytes, std::size_t at, Words& words) HAPTIC_RT {
    for (std::size_t i = 0; i < kStrings; ++i) {
        words[i] = load_word(bytes, at + 2 * i);
    }
}

void store_words(std::span<std::byte> bytes, std::size_t at, const Words& words) HAPTIC_RT {
    for (std::size_t i = 0; i < kStrings; ++i) {
        store_word(bytes, at + 2 * i, words[i]);
    }
}

}  // namespace

void encode(const Sh4Command& command, std::span<std::byte, kSh4PacketBytes> out) HAPTIC_RT {
    std::fill(out.begin(), out.end(), std::byte{0});
    out[0] = kUpdateAll;
    out[1] = kBaseAnalyser;
    for (std::size_t i = 0; i < kStrings; ++i) {
        store_word(out, kOutDacCodes + 2 * i, std::min<std::uint16_t>(command.dac_codes[i], kMaxDacCode));
    }
}

PacketDefect decode(std::span<const std::byte> in, Sh4Reply& reply) HAPTIC_RT {
    if (in.size() != kSh4PacketBytes) {
        return PacketDefect::Length;
    }
    // The words are not validated: the contents of echo, A/D and info on real boards are not known for certain.
    load_words(in, kInDacCodes, reply.dac_codes);
    load_words(in, kInCounters, reply.counters);
    load_words(in, kInAnalog, reply.analog);
    reply.pio = load_word(in, kInPio);
    const std::uint32_t low = load_word(in, kInInfo);
    const std::uint32_t high = load_word(in, kInInfo + 2);
    reply.info = low | (high << 16U);
    return PacketDefect::None;
}

PacketDefect decode(std::span<const std::byte> out, Sh4Command& command) HAPTIC_RT {
    if (out.size() != kSh4PacketBytes) {
        return PacketDefect::Length;
    }
    if (out[0] != kUpdateAll || out[1] != kBaseAnalyser) {
        return PacketDefect::Opcode;
    }
    // Validate all codes before writing any.
    Words dac_codes{};
    load_words(out, kOutDacCodes, dac_codes);
    for (const std::uint16_t dac_code : dac_codes) {
        if (dac_code > kMaxDacCode) {
            return PacketDefect::DacCode;
        }
    }
    command.dac_codes = dac_codes;
    return PacketDefect::None;
}

void encode(const Sh4Reply& reply, std::span<std::byte, kSh4PacketBytes> in) HAPTIC_RT {
    std::fill(in.begin(), in.end(), std::byte{0});
    store_words(in, kInDacCodes, reply.dac_codes);
    store_words(in, kInCounters, reply.counters);
    store_words(in, kInAnalog, reply.analog);
    store_word(in, kInPio, reply.pio);
    store_word(in, kInInfo, static_cast<std::uint16_t>(reply.info & 0xFFFFU));
    store_word(in, kInInfo + 2, static_cast<std::uint16_t>(reply.info >> 16U));
}

}  // namespace haptic::device
