// Joined words: a list of words as one text.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace haptic::detail {

/// The words with the separator between them.
[[nodiscard]] inline std::string joined(const std::vector<std::string>& words, std::string_view separator) {
    std::string text;
    for (const std::string& word : words) {
        text.append(text.empty() ? std::string_view() : separator).append(word);
    }
    return text;
}

}  // namespace haptic::detail
