#include "codecs/uart_codec.hpp"

#include <algorithm>

#include "codecs/packet_bytes.hpp"

namespace haptic::device {
namespace {

constexpr unsigned kIdMask = 0x07;
constexpr unsigned kCommandShift = 3;

std::byte header_of(int id, UartCommand command) HAPTIC_RT {
    return encode_header({id, static_cast<std::uint8_t>(command)});
}

/// Checks length and header of a packet in either direction.
PacketDefect find_defect(std::span<const std::byte> packet, std::size_t length, int id, UartCommand command) HAPTIC_RT {
    if (packet.size() != length) {
        return PacketDefect::Length;
    }
    return packet[0] == header_of(id, command) ? PacketDefect::None : PacketDefect::Opcode;
}

}  // namespace

bool is_usable(const UartBoardInfo& info) HAPTIC_RT {
    return info.model != 0 && info.motors >= 1 && info.motors <= kStrings && info.forces <= kUartMaximumForces;
}

std::byte encode_header(const UartHeader& header) HAPTIC_RT {
    const auto id = static_cast<unsigned>(header.id) & kIdMask;
    return static_cast<std::byte>((id | (static_cast<unsigned>(header.command) << kCommandShift)) & 0xFFU);
}

UartHeader decode_header(std::byte header) HAPTIC_RT {
    const auto bits = std::to_integer<unsigned>(header);
    return {static_cast<int>(bits & kIdMask), static_cast<std::uint8_t>(bits >> kCommandShift)};
}

UartLengths uart_lengths(const UartBoardInfo& info) HAPTIC_RT {
    const unsigned words = 2U * info.motors;                           // bytes: one int16 per motor
    const unsigned jacobian = words * std::max(1U, 0U + info.forces);  // and one per motor and force sensor
    const unsigned force_control = info.forces == 0 ? words : words + jacobian;
    // In the order of UartCommand. @source Springhead, commandTemplate.h
    const std::array<unsigned, kUartCommands> bytes = {1,
                                                       1,
                                                       static_cast<unsigned>(kUartLengthsBytes),
                                                       5 + words + jacobian,
                                                       1,
                                                       1 + 2 * words,
                                                       1 + words,
                                                       4 + words,
                                                       4 + force_control,
                                                       2 + 2 * words,
                                                       3,
                                                       2};
    UartLengths lengths{};
    std::transform(bytes.begin(), bytes.end(), lengths.begin(),
                   [](unsigned count) HAPTIC_RT { return static_cast<std::uint8_t>(count); });
    return lengths;
}

PacketDefect encode_currents(int id, const UartBoardInfo& info, const UartCurrents& currents,
                             std::span<std::byte> out) HAPTIC_RT {
    if (out.size() != uart_current_command_bytes(info)) {
        return PacketDefect::Length;
    }
    out[0] = header_of(id, UartCommand::Current);
    for (std::size_t i = 0; i < info.motors; ++i) {
        const int clamped = std::clamp<int>(currents[i], -kMaxDacCode, kMaxDacCode);
        store_word(out, 1 + 2 * i, static_cast<std::uint16_t>(clamped));
    }
    return PacketDefect::None;
}

PacketDefect encode_lengths(int id, const UartLengths& lengths, std::span<std::byte> out) HAPTIC_RT {
    if (out.size() != kUartLengthsBytes) {
        return PacketDefect::Length;
    }
    out[0] = header_of(id, UartCommand::SetLengths);
    for (std::size_t i = 0; i < kUartCommands; ++i) {
        out[1 + i] = std::byte{lengths[i]};
    }
    return PacketDefect::None;
}

PacketDefect decode_info(std::span<const std::byte> in, int id, UartBoardInfo& info) HAPTIC_RT {
    const PacketDefect defect = find_defect(in, kUartInfoReplyBytes, id, UartCommand::BoardInfo);
    if (defect == PacketDefect::None) {
        const auto field = [&](std::size_t at) HAPTIC_RT { return std::to_integer<std::uint8_t>(in[at]); };
        info = {field(1), field(2), field(3), field(4), field(5), field(6)};
    }
    return defect;
}

PacketDefect decode_reply(std::span<const std::byte> in, int id, const UartBoardInfo& info,
                          UartReply& reply) HAPTIC_RT {
    const PacketDefect defect = find_defect(in, uart_current_reply_bytes(info), id, UartCommand::Current);
    if (defect != PacketDefect::None) {
        return defect;
    }
    // After the header: positions, velocities, forces.
    std::size_t at = 1;
    for (std::size_t i = 0; i < info.motors; ++i, at += 2) {
        reply.positions[i] = load_word(in, at);
    }
    for (std::size_t i = 0; i < info.motors; ++i, at += 2) {
        reply.velocities[i] = static_cast<std::int16_t>(load_word(in, at));
    }
    for (std::size_t i = 0; i < info.forces; ++i, at += 2) {
        reply.forces[i] = static_cast<std::int16_t>(load_word(in, at));
    }
    return PacketDefect::None;
}

PacketDefect decode_currents(std::span<const std::byte> out, int id, const UartBoardInfo& info,
                             UartCurrents& currents) HAPTIC_RT {
    const PacketDefect defect = find_defect(out, uart_current_command_bytes(info), id, UartCommand::Current);
    if (defect != PacketDefect::None) {
        return defect;
    }
    // `currents` is written only if all values are in range.
    UartCurrents found = currents;
    for (std::size_t i = 0; i < info.motors; ++i) {
        found[i] = static_cast<std::int16_t>(load_word(out, 1 + 2 * i));
        if (found[i] > kMaxDacCode || found[i] < -kMaxDacCode) {
            return PacketDefect::DacCode;
        }
    }
    currents = found;
    return PacketDefect::None;
}

PacketDefect decode_lengths(std::span<const std::byte> out, int id, UartLengths& lengths) HAPTIC_RT {
    const PacketDefect defect = find_defect(out, kUartLengthsBytes, id, UartCommand::SetLengths);
    if (defect == PacketDefect::None) {
        for (std::size_t i = 0; i < kUartCommands; ++i) {
            lengths[i] = std::to_integer<std::uint8_t>(out[1 + i]);
        }
    }
    return defect;
}

PacketDefect encode_info(int id, const UartBoardInfo& info, std::span<std::byte> in) HAPTIC_RT {
    if (in.size() != kUartInfoReplyBytes) {
        return PacketDefect::Length;
    }
    in[0] = header_of(id, UartCommand::BoardInfo);
    const std::array<std::uint8_t, 6> fields = {info.model,    info.targets, info.motors,
                                                info.currents, info.forces,  info.touches};
    for (std::size_t i = 0; i < fields.size(); ++i) {
        in[1 + i] = std::byte{fields[i]};
    }
    return PacketDefect::None;
}

PacketDefect encode_reply(int id, const UartBoardInfo& info, const UartReply& reply,
                          std::span<std::byte> in) HAPTIC_RT {
    if (in.size() != uart_current_reply_bytes(info)) {
        return PacketDefect::Length;
    }
    in[0] = header_of(id, UartCommand::Current);
    std::size_t at = 1;
    for (std::size_t i = 0; i < info.motors; ++i, at += 2) {
        store_word(in, at, reply.positions[i]);
    }
    for (std::size_t i = 0; i < info.motors; ++i, at += 2) {
        store_word(in, at, static_cast<std::uint16_t>(reply.velocities[i]));
    }
    for (std::size_t i = 0; i < info.forces; ++i, at += 2) {
        store_word(in, at, static_cast<std::uint16_t>(reply.forces[i]));
    }
    return PacketDefect::None;
}

}  // namespace haptic::device
