// Page files: the live view's page, compiled into the executable.
#pragma once

#include <cstddef>
#include <span>
#include <string_view>

namespace haptic::sim::view {

struct PageFile {
    std::string_view path;  // where it is served, e.g. "/page.js"
    std::string_view type;  // e.g. "text/javascript; charset=utf-8"
    std::span<const std::byte> content;
    std::span<const std::byte> gzip{};  // the same, compressed; empty: it is not
};

[[nodiscard]] std::span<const PageFile> page_files();

}  // namespace haptic::sim::view
