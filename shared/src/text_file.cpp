#include "haptic/text_file.hpp"

#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <fstream>
#include <stdexcept>
#include <string>
#include <system_error>

namespace haptic {
namespace {

/// Name of the temporary file that will be renamed to `file`. `file` itself if it is not a regular file, which a rename
/// would replace.
std::filesystem::path temporary_beside(const std::filesystem::path& file) {
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

}  // namespace

void write_text(const std::filesystem::path& file, std::string_view text) {
    const std::filesystem::path temporary = temporary_beside(file);
    errno = 0;
    std::ofstream stream(temporary, std::ios::binary | std::ios::trunc);
    stream << text;
    stream.close();
    std::error_code error;
    if (!stream) {
        error = {errno != 0 ? errno : EIO, std::generic_category()};
    } else if (temporary != file) {
        std::filesystem::rename(temporary, file, error);
    }
    if (error) {
        std::error_code ignored;
        if (temporary != file) {
            std::filesystem::remove(temporary, ignored);
        }
        throw std::runtime_error(file.string() + ": cannot be written: " + error.message());
    }
}

std::filesystem::path free_backup_name(const std::filesystem::path& file, int most) {
    std::error_code ignored;
    for (int number = 1; number <= most; ++number) {
        std::filesystem::path backup = file;
        backup += ".bak-" + std::to_string(number);
        if (!std::filesystem::exists(backup, ignored)) {
            return backup;
        }
    }
    return {};
}

}  // namespace haptic
