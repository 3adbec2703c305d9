// Codec of the UART motor boards (X4, X5, T1), both directions. Driver and emulated boards use the same functions.
//
// Up to eight boards share one line of 2 Mbit/s, 8N1. A packet is a header byte, board id | command << 3, followed by
// the command's contents; words are int16, little-endian. A board has `motors` motors and `forces` force sensors:
//   1 board info    1 byte                                  reply of 7: header, model, targets, motors, currents,
//                                                           forces, touches
//   2 set lengths   13: length of each of the 12 commands to this board, so that other boards can skip them   no reply
//   6 current       1 + 2 motors: currents, -4095..4095     reply of 1 + 4 motors + 2 forces: positions, velocities,
//                                                           forces
// Packets are distinguished only by their header and have no checksum. A board sends one byte of its reply for each
// byte that it receives, so a command is followed by zeros; a zero byte is the command "none" to board 0.
// @source device-facts, section 2.6; Springhead, DRUartMotorDriver and commandTemplate.h.
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

inline constexpr int kUartIds = 8;
inline constexpr std::size_t kUartCommands = 12;
inline constexpr int kUartMaximumForces = 4;

inline constexpr std::size_t kUartInfoCommandBytes = 1;
inline constexpr std::size_t kUartInfoReplyBytes = 7;
inline constexpr std::size_t kUartLengthsBytes = 1 + kUartCommands;
inline constexpr std::size_t kUartLongestCurrentCommand = 1 + 2 * kStrings;
inline constexpr std::size_t kUartLongestCurrentReply = 1 + 4 * kStrings + 2 * std::size_t{kUartMaximumForces};
// The longest command of all: "All" to a board with 8 motors and 4 force sensors.
inline constexpr std::size_t kUartLongestCommand = 85;

enum class UartCommand : std::uint8_t {
    None = 0,
    BoardInfo = 1,
    SetLengths = 2,
    All = 3,
    Sensor = 4,
    Direct = 5,
    Current = 6,
    Interpolate = 7,
    ForceControl = 8,
    SetParameter = 9,
    ResetSensor = 10,
    GetParameter = 11
};

struct UartHeader {
    int id = 0;                // 0..7
    std::uint8_t command = 0;  // UartCommand, or a larger number without meaning

    friend bool operator==(const UartHeader&, const UartHeader&) = default;
};

/// Properties that a board reports.
struct UartBoardInfo {
    std::uint8_t model = 0;  // 5: "B3M" of 4 motors; 7: "B5M" of 8 motors and 4 force sensors
    std::uint8_t targets = 0;
    std::uint8_t motors = 0;
    std::uint8_t currents = 0;
    std::uint8_t forces = 0;
    std::uint8_t touches = 0;

    friend bool operator==(const UartBoardInfo&, const UartBoardInfo&) = default;
};

/// The two boards known from Spidar-G6 devices.
inline constexpr UartBoardInfo kUartB3M{5, 12, 4, 4, 0, 0};
inline constexpr UartBoardInfo kUartB5M{7, 12, 8, 8, 4, 0};

/// Whether the driver supports such a board: 1 to 8 motors, at most 4 force sensors, a nonzero model.
[[nodiscard]] bool is_usable(const UartBoardInfo& info) HAPTIC_RT;

struct UartReply {
    std::array<std::uint16_t, kStrings> positions{};        // raw, wrapping; 1024 a motor turn
    std::array<std::int16_t, kStrings> velocities{};        // unit unknown
    std::array<std::int16_t, kUartMaximumForces> forces{};  // unit unknown

    friend bool operator==(const UartReply&, const UartReply&) = default;
};

using UartCurrents = std::array<std::int16_t, kStrings>;  // the first `motors` elements
using UartLengths = std::array<std::uint8_t, kUartCommands>;

[[nodiscard]] std::byte encode_header(const UartHeader& header) HAPTIC_RT;
[[nodiscard]] UartHeader decode_header(std::byte header) HAPTIC_RT;

/// Packet lengths of usable boards.
[[nodiscard]] constexpr std::size_t uart_current_command_bytes(const UartBoardInfo& info) HAPTIC_RT {
    return 1 + 2 * std::size_t{info.motors};
}
[[nodiscard]] constexpr std::size_t uart_current_reply_bytes(const UartBoardInfo& info) HAPTIC_RT {
    return 1 + 4 * std::size_t{info.motors} + 2 * std::size_t{info.forces};
}
/// Length of each command to such a board, header included.
[[nodiscard]] UartLengths uart_lengths(const UartBoardInfo& info) HAPTIC_RT;

// Encoders require a span of exactly the packet's length; otherwise they leave it unchanged and return Length. Decoders
// check the length, and that the header has the expected id and command.

/// Host side. Currents are clamped to +-kMaxDacCode.
PacketDefect encode_currents(int id, const UartBoardInfo& info, const UartCurrents& currents,
                             std::span<std::byte> out) HAPTIC_RT;
PacketDefect encode_lengths(int id, const UartLengths& lengths, std::span<std::byte> out) HAPTIC_RT;
[[nodiscard]] PacketDefect decode_info(std::span<const std::byte> in, int id, UartBoardInfo& info) HAPTIC_RT;
[[nodiscard]] PacketDefect decode_reply(std::span<const std::byte> in, int id, const UartBoardInfo& info,
                                        UartReply& reply) HAPTIC_RT;

/// Board side.
[[nodiscard]] PacketDefect decode_currents(std::span<const std::byte> out, int id, const UartBoardInfo& info,
                                           UartCurrents& currents) HAPTIC_RT;
[[nodiscard]] PacketDefect decode_lengths(std::span<const std::byte> out, int id, UartLengths& lengths) HAPTIC_RT;
PacketDefect encode_info(int id, const UartBoardInfo& info, std::span<std::byte> in) HAPTIC_RT;
PacketDefect encode_reply(int id, const UartBoardInfo& info, const UartReply& reply, std::span<std::byte> in) HAPTIC_RT;

}  // namespace haptic::device
