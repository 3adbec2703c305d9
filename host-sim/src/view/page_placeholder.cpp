// In place of the page, until there is one.
#include "view/page_files.hpp"

namespace haptic::sim::view {

std::span<const PageFile> page_files() {
    static constexpr std::string_view text = "<!doctype html><title>host-sim</title>The stream is at /stream.";
    static const PageFile file{"/", "text/html; charset=utf-8", std::as_bytes(std::span(text))};
    return {&file, 1};
}

}  // namespace haptic::sim::view
