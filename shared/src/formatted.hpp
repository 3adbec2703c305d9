// Text by a format of printf.
#pragma once

#include <array>
#include <cstdarg>
#include <cstdio>
#include <string>

namespace haptic::detail {

/// Cut after 299 characters.
[[gnu::format(printf, 1, 2)]] inline std::string formatted(const char* format, ...) {
    std::array<char, 300> line{};
    va_list values;
    va_start(values, format);
    std::vsnprintf(line.data(), line.size(), format, values);
    va_end(values);
    return line.data();
}

}  // namespace haptic::detail
