// Text file: a result that is written as a whole, so that readers never see an incomplete one; and names under which
// earlier results are kept.
#pragma once

#include <filesystem>
#include <limits>
#include <string_view>

namespace haptic {

/// Writes a temporary file beside `file` and renames it; a pipe or a device (/dev/stdout) is written itself. An old
/// file stays as it was if the new one cannot be written. Throws std::runtime_error: file and reason.
void write_text(const std::filesystem::path& file, std::string_view text);

/// The first of FILE.bak-1 to FILE.bak-`most` that does not exist; empty if all do.
[[nodiscard]] std::filesystem::path free_backup_name(const std::filesystem::path& file,
                                                     int most = std::numeric_limits<int>::max());

}  // namespace haptic
