// What the implementations of haptic/gpio.hpp share: how a line is named, and the messages if it cannot be opened.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "haptic/gpio.hpp"

namespace haptic::detail {

/// Size of the kernel's buffer of edges, and limit of one read.
inline constexpr std::size_t kEdgeBufferSize = 16;

/// The number of a line or chip if the text consists of digits, at most six.
[[nodiscard]] std::optional<unsigned> parse_gpio_number(const std::string& text);

// These throw std::runtime_error with the line's purpose, the problem, the text of errno and a remedy. They take errno
// = 0 for "not found".
[[noreturn]] void throw_no_gpio_chip(const GpioLine& line);
[[noreturn]] void throw_no_gpio_line(const GpioLine& line);
[[noreturn]] void throw_gpio_line_refused(const GpioLine& line);

}  // namespace haptic::detail
