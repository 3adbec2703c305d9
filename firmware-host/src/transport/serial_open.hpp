// Opens and closes a serial line. May allocate and block.
#pragma once

#include <filesystem>

namespace haptic::device {

/// Returns a non-blocking descriptor: raw, 8N1, without flow control, exclusive. Throws BoardError with the system's
/// refusal and a remedy.
[[nodiscard]] int open_serial_line(const std::filesystem::path& path, int baud);

/// No effect for a negative descriptor.
void close_serial_line(int descriptor) noexcept;

/// Whether open_serial_line() accepts a rate, bit/s: those that termios names.
[[nodiscard]] bool is_serial_speed(int baud) noexcept;

}  // namespace haptic::device
