// Where a result is written until it is whole: beside its place, so that a reader never sees half of it.
#pragma once

#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <string>
#include <system_error>

namespace haptic::detail {

/// The temporary file that will be renamed to `file`; `file` itself where there is something that a rename would
/// replace by a plain file (/dev/null, /dev/stdout, a pipe).
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

/// Gives up what was written so far.
inline void discard(const std::filesystem::path& temporary, const std::filesystem::path& file) noexcept {
    if (temporary != file) {
        std::error_code ignored;
        std::filesystem::remove(temporary, ignored);
    }
}

/// Puts the whole file in its place. Where that fails the temporary file is removed.
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
