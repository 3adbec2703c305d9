// Text on the pages that both processes write.
#pragma once

#include <string>
#include <string_view>

namespace haptic {

/// The text as it may stand in HTML and SVG, between tags and in quoted attributes.
[[nodiscard]] std::string html_text(std::string_view text);

}  // namespace haptic
