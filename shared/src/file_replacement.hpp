// Where a result is written until it is whole: beside its place, so that a reader never sees half of it.
#pragma once

#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <string>

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

}  // namespace haptic::detail
