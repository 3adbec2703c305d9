// HTML helpers shared by the pages that both processes write.
#pragma once

#include <string>
#include <string_view>

namespace haptic {

/// Escapes text for HTML and SVG content and quoted attributes.
[[nodiscard]] std::string html_text(std::string_view text);

/// Start of a page, up to and including its title as first heading, with the style sheet. The caller appends the
/// content and "</body></html>".
[[nodiscard]] std::string page_top(std::string_view title);

/// Style sheet of all pages, page/style.css.
[[nodiscard]] std::string_view page_style();

}  // namespace haptic
