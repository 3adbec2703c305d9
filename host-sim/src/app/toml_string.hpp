// TOML string: quotes a command-line argument for Config::set().
#pragma once

#include <string>

namespace haptic::sim {

/// `text` as a quoted TOML string.
[[nodiscard]] inline std::string toml_string(const std::string& text) {
    std::string result = "\"";
    for (const char c : text) {
        if (c == '"' || c == '\\') {
            result += '\\';
        }
        result += c;
    }
    return result + '"';
}

}  // namespace haptic::sim
