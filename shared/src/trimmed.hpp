// Trimmed text: without the blanks at its ends.
#pragma once

#include <cstddef>
#include <string_view>

namespace haptic::detail {

/// The text without spaces, tabs and carriage returns at its ends. Refers to the same characters.
[[nodiscard]] inline std::string_view trimmed(std::string_view text) noexcept {
    constexpr std::string_view blanks = " \t\r";
    const std::size_t begin = text.find_first_not_of(blanks);
    return begin == std::string_view::npos ? std::string_view{}
                                           : text.substr(begin, text.find_last_not_of(blanks) - begin + 1);
}

}  // namespace haptic::detail
