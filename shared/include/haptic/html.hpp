// What the pages that both processes write have in common.
#pragma once

#include <string>
#include <string_view>

namespace haptic {

/// The text as it may stand in HTML and SVG, between tags and in quoted attributes.
[[nodiscard]] std::string html_text(std::string_view text);

/// What stands before the content of a page that is read from top to bottom: all up to its title as its first heading,
/// with the style sheet in it. The page ends with "</body></html>".
[[nodiscard]] std::string page_top(std::string_view title);

/// The style sheet of all pages, page/style.css.
[[nodiscard]] std::string_view page_style();

}  // namespace haptic
