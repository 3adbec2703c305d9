// The system calls of an exchange over a serial line, each with its bound.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include <haptic/realtime.hpp>

namespace haptic::device {

enum class LineState : std::uint8_t {
    Moved,  // some bytes
    Idle,   // none now
    Gone    // hung up, or taken away
};

struct LineResult {
    LineState state = LineState::Idle;
    std::size_t bytes = 0;
};

/// As many bytes as the kernel takes at once.
[[nodiscard]] LineResult line_write(int descriptor, std::span<const std::byte> out) HAPTIC_RT;
/// As many bytes as have come.
[[nodiscard]] LineResult line_read(int descriptor, std::span<std::byte> in) HAPTIC_RT;

enum class LineEvent : std::uint8_t { Input, Room };
/// Waits until there is input, or room for output: Moved; Idle if the time is over first.
[[nodiscard]] LineState line_wait(int descriptor, LineEvent event, std::int64_t at_most_ns) HAPTIC_RT;

}  // namespace haptic::device
