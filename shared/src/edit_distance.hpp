// Edit distance of words, to guess which known word a mistyped one was meant to be.
#pragma once

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace haptic::detail {

/// Number of insertions, deletions, replacements and swaps of neighbours that turn a into b (optimal string alignment).
[[nodiscard]] inline std::size_t edit_distance(std::string_view a, std::string_view b) {
    std::vector<std::size_t> before_last(b.size() + 1);
    std::vector<std::size_t> last(b.size() + 1);
    std::vector<std::size_t> row(b.size() + 1);
    std::iota(last.begin(), last.end(), std::size_t{0});
    for (std::size_t i = 1; i <= a.size(); ++i) {
        row[0] = i;
        for (std::size_t j = 1; j <= b.size(); ++j) {
            const std::size_t replaced = last[j - 1] + (a[i - 1] == b[j - 1] ? 0u : 1u);
            row[j] = std::min({replaced, last[j] + 1, row[j - 1] + 1});
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
                row[j] = std::min(row[j], before_last[j - 2] + 1);
            }
        }
        std::swap(before_last, last);
        std::swap(last, row);
    }
    return last.back();
}

/// A known word that is further than this from a mistyped one was not meant.
[[nodiscard]] inline std::size_t max_edit_distance(std::string_view word) noexcept {
    return std::max<std::size_t>(2, word.size() / 3);
}

/// "; did you mean X?" with the nearest of the known words, or nothing. `quote`: on either side of X.
[[nodiscard]] inline std::string guess(std::string_view given, std::span<const std::string> known,
                                       std::string_view quote = "") {
    const std::string* nearest = nullptr;
    std::size_t distance = max_edit_distance(given) + 1;
    for (const std::string& word : known) {
        if (const std::size_t d = edit_distance(given, word); d < distance) {
            nearest = &word;
            distance = d;
        }
    }
    return nearest == nullptr ? "" : "; did you mean " + std::string(quote) + *nearest + std::string(quote) + "?";
}

}  // namespace haptic::detail
