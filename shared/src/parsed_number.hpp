// Parsed number: a text that is one number as a whole.
#pragma once

#include <charconv>
#include <optional>
#include <string_view>
#include <system_error>

namespace haptic::detail {

/// The whole text as a number; empty if it is none or out of range. No blanks, and no sign but a minus.
template <class Number>
[[nodiscard]] std::optional<Number> parsed_number(std::string_view text) {
    Number value{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    return error == std::errc{} && end == text.data() + text.size() ? std::optional(value) : std::nullopt;
}

/// The same after an optional plus.
template <class Number>
[[nodiscard]] std::optional<Number> parsed_signed_number(std::string_view text) {
    text.remove_prefix(text.starts_with('+') ? 1 : 0);
    return parsed_number<Number>(text);
}

}  // namespace haptic::detail
