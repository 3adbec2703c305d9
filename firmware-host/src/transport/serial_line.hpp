// System calls of an exchange over a serial line, each with its bound.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "haptic/realtime.hpp"

namespace haptic::device {

enum class LineState : std::uint8_t {
    Moved,  // some bytes were transferred
    Idle,   // none at present
    Gone    // hung up or removed
};

struct LineResult {
    LineState state = LineState::Idle;
    std::size_t bytes = 0;
};

/// Writes as many bytes as the kernel accepts immediately.
[[nodiscard]] LineResult line_write(int descriptor, std::span<const std::byte> out) HAPTIC_RT;
/// Reads the bytes that have arrived.
[[nodiscard]] LineResult line_read(int descriptor, std::span<std::byte> in) HAPTIC_RT;

enum class LineEvent : std::uint8_t { Input, Room };
/// Waits for input, or for space for output: Moved. Idle if max_wait_ns passes first.
[[nodiscard]] LineState line_wait(int descriptor, LineEvent event, std::int64_t max_wait_ns) HAPTIC_RT;

}  // namespace haptic::device
