// Puts a variant into a file without ever losing the one that was there.
#pragma once

#include <filesystem>
#include <optional>
#include <string_view>

#include "haptic/device/variant.hpp"

namespace haptic::device {

/// Writes to_toml(variant, comment) beside `file`, reads it back, keeps what `file` was as file.bak-1, -2, ..., and
/// only then renames the new one into its place. Wherever that fails, `file` is what it was. The name of the backup, if
/// there was something to keep. Throws std::runtime_error that names the file and what went wrong.
std::optional<std::filesystem::path> write_variant(const std::filesystem::path& file, const Variant& variant,
                                                   std::string_view comment);

}  // namespace haptic::device
