// Zero packet: what another process needs to set the motors of a board to zero, after the loop's process has ended or
// while it is frozen.
//
// Processes that share an open file description share what the kernel allows it: a claimed USB interface, a locked
// serial line. So a process that received the descriptor can send, with the loop's process alive or dead. Whatever the
// loop had submitted to the same endpoint or line goes out first.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "haptic/device/exchange_status.hpp"

namespace haptic::device {

enum class LinkKind : std::uint8_t { None, Usb, Serial };

/// An open device.
struct DeviceLink {
    LinkKind kind = LinkKind::None;
    int descriptor = -1;  // of the process that opened it, which closes it
};

struct ZeroPacket {
    static constexpr std::size_t kMaxBytes = 512;

    DeviceLink link;
    std::array<std::byte, kMaxBytes> bytes{};
    std::uint32_t size = 0;  // 0: nothing can be sent

    [[nodiscard]] std::span<const std::byte> packet() const noexcept { return std::span(bytes).first(size); }
    /// Replaces the packet. One that is too long leaves none.
    void set_packet(std::span<const std::byte> packet) noexcept;
};

/// Commands that wait in the kernel's buffer of a serial line. Dropped ones cannot delay the zeros; but zeros that
/// still wait there themselves must be kept when they are sent again.
enum class Waiting : std::uint8_t { Drop, Keep };

/// Sends the packet, whatever state the other process has left the link in, and discards the board's answers, so that
/// it is not left waiting to get rid of them. Allocates nothing.
///
///   USB     a halted endpoint is cleared. A board that does not take the packet within 3 ms may be waiting for its
///           answers to be read: they are, and it is tried again
///   serial  the packet begins with the zeros that end a command that was sent in part, or dropped in part
///
/// Takes less than 1 ms if the board accepts the packet at once, and at most about 30 ms.
ExchangeStatus send_zero_packet(const ZeroPacket& zero, Waiting waiting = Waiting::Drop) noexcept;

}  // namespace haptic::device
