// Opening and closing a serial line, which may allocate and wait.
#pragma once

#include <filesystem>

namespace haptic::device {

/// A descriptor that does not block: raw, 8N1, without flow control, for nobody else. Throws BoardError that says what
/// the system refuses and what to do.
[[nodiscard]] int open_serial_line(const std::filesystem::path& path, int baud);

/// Nothing for a negative descriptor.
void close_serial_line(int descriptor) noexcept;

/// The speeds that termios has a name for and that open_serial_line takes, bit/s.
[[nodiscard]] bool is_serial_speed(int baud) noexcept;

}  // namespace haptic::device
