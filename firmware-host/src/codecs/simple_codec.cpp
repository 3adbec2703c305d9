#include "codecs/simple_codec.hpp"

#include <algorithm>

#include "codecs/packet_bytes.hpp"

namespace haptic::device {
namespace {

constexpr std::byte kEncoders{0xA2};
constexpr std::byte kPhase{0x1A};
constexpr std::byte kClear{0x19};
constexpr std::byte kDacCodes{0x52};
constexpr std::byte kLatch{0x51};

// Offsets in an OUT packet.
constexpr std::size_t kOutChannels = 2;
constexpr std::size_t kOutFirstDacCode = 1;
// Offsets in an IN packet.
constexpr std::size_t kCounterBytes = 3;
constexpr std::size_t kInPioByte = 24;

}  // namespace

void encode(const SimpleCommand& command, std::span<std::byte, kSimplePacketBytes> out) HAPTIC_RT {
    std::fill(out.begin(), out.end(), std::byte{0});
    switch (command.request) {
        case SimpleRequest::Phase:
        case SimpleRequest::Clear:
            out[0] = kEncoders;
            out[1] = command.request == SimpleRequest::Phase ? kPhase : kClear;
            out[kOutChannels] = std::byte{command.channels};
            break;
        case SimpleRequest::DacCodes:
            out[0] = kDacCodes;
            for (std::size_t i = 0; i < kStrings; ++i) {
                store_word(out, kOutFirstDacCode + 2 * i, std::min<std::uint16_t>(command.dac_codes[i], kMaxDacCode));
            }
            break;
        case SimpleRequest::Latch:
            out[0] = kLatch;
            break;
    }
}

PacketDefect decode(std::span<const std::byte> in, SimpleReply& reply) HAPTIC_RT {
    if (in.size() != kSimplePacketBytes) {
        return PacketDefect::Length;
    }
    for (std::size_t i = 0; i < kStrings; ++i) {
        const std::size_t at = kCounterBytes * i;
        const auto high = std::to_integer<std::uint32_t>(in[at + 2]);
        reply.counters[i] = load_word(in, at) | (high << 16U);
    }
    reply.pio = std::to_integer<std::uint8_t>(in[kInPioByte]);
    return PacketDefect::None;
}

PacketDefect decode(std::span<const std::byte> out, SimpleCommand& command) HAPTIC_RT {
    if (out.size() != kSimplePacketBytes) {
        return PacketDefect::Length;
    }
    // `command` is written only if the whole packet is valid.
    SimpleCommand found;
    if (out[0] == kEncoders && (out[1] == kPhase || out[1] == kClear)) {
        found.request = out[1] == kPhase ? SimpleRequest::Phase : SimpleRequest::Clear;
        found.channels = std::to_integer<std::uint8_t>(out[kOutChannels]);
    } else if (out[0] == kDacCodes) {
        found.request = SimpleRequest::DacCodes;
        for (std::size_t i = 0; i < kStrings; ++i) {
            found.dac_codes[i] = load_word(out, kOutFirstDacCode + 2 * i);
            if (found.dac_codes[i] > kMaxDacCode) {
                return PacketDefect::DacCode;
            }
        }
    } else if (out[0] != kLatch) {
        return PacketDefect::Opcode;
    }
    command = found;
    return PacketDefect::None;
}

void encode(const SimpleReply& reply, std::span<std::byte, kSimplePacketBytes> in) HAPTIC_RT {
    std::fill(in.begin(), in.end(), std::byte{0});
    for (std::size_t i = 0; i < kStrings; ++i) {
        const std::size_t at = kCounterBytes * i;
        store_word(in, at, static_cast<std::uint16_t>(reply.counters[i] & 0xFFFFU));
        in[at + 2] = static_cast<std::byte>((reply.counters[i] >> 16U) & 0xFFU);
    }
    in[kInPioByte] = std::byte{reply.pio};
}

}  // namespace haptic::device
