// File replacement: a result is written to a temporary file next to its destination and renamed when complete, so that
// readers never see an incomplete file.
#pragma once

#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <string>
#include <system_error>

namespace haptic::detail {

/// Name of the temporary file that will be renamed to `file`. `file` itself if it is not a regular file (/dev/null,
/// /dev/stdout, a pipe), which a rename would replace.
inline std::filesystem::path temporary_beside(const std::filesystem::path& file) {
    static std::atomic<unsigned> serial{0};
    std::error_code ignored;
    const std::filesystem::file_status status = std::filesystem::status(file, ignored);
    if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) {
        return file;
    }
    std::filesystem::path temporary = file;
    temporary += ".part-" + std::to_string(::getpid()) + "-" + std::to_string(serial.fetch_add(1));
    return temporary;
}

/// Removes the temporary file.
inline void discard(const std::filesystem::path& temporary, const std::filesystem::path& file) noexcept {
    if (temporary != file) {
        std::error_code ignored;
        std::filesystem::remove(temporary, ignored);
    }
}

/// Renames the complete file to its destination. Removes the temporary file on failure.
[[nodiscard]] inline std::error_code put_in_place(const std::filesystem::path& temporary,
                                                  const std::filesystem::path& file) noexcept {
    std::error_code error;
    if (temporary != file) {
        std::filesystem::rename(temporary, file, error);
        if (error) {
            discard(temporary, file);
        }
    }
    return error;
}

}  // namespace haptic::detail
