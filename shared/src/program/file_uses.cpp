#include "program/file_uses.hpp"

#include <stdexcept>
#include <system_error>
#include <utility>

namespace haptic {
namespace {

/// Where a file is or will be: without a slash at the end, and as it is written where links cannot be followed.
std::filesystem::path place_of(const std::filesystem::path& file) {
    std::error_code error;
    const std::filesystem::path named = (std::filesystem::absolute(file, error) / "").parent_path();
    const std::filesystem::path place = std::filesystem::weakly_canonical(named, error);
    return place.empty() ? named.lexically_normal() : place;
}

}  // namespace

void FileUses::add(Use use) {
    std::error_code error;
    const std::filesystem::file_status status = std::filesystem::status(use.file, error);
    if (!use.file.empty() && !std::filesystem::is_character_file(status) && !std::filesystem::is_fifo(status)) {
        uses_.push_back(std::move(use));
    }
}

void FileUses::reads(const std::string& option, const std::optional<std::filesystem::path>& file) {
    if (file) {
        add({.given = option + file->string(), .file = *file, .written = false, .derived = false});
    }
}

void FileUses::writes(const std::string& option, const std::optional<std::filesystem::path>& file) {
    if (file) {
        add({.given = option + file->string(), .file = *file, .written = true, .derived = false});
    }
}

void FileUses::also_reads(const std::string& given, const std::filesystem::path& file) {
    add({.given = given, .file = file, .written = false, .derived = true});
}

void FileUses::also_writes(const std::string& given, const std::filesystem::path& file) {
    add({.given = given, .file = file, .written = true, .derived = true});
}

bool FileUses::same_file(const Use& a, const Use& b) {
    // Hard links are equivalent under two places; files that do not exist yet have only a place.
    std::error_code error;
    return std::filesystem::equivalent(a.file, b.file, error) || place_of(a.file) == place_of(b.file);
}

void FileUses::require_distinct() const {
    for (const Use& written : uses_) {
        for (const Use& other : uses_) {
            if (!written.written || written.given == other.given || !same_file(written, other)) {
                continue;
            }
            throw std::invalid_argument(written.given + " would " + (written.derived ? "also write " : "write ") +
                                        written.file.string() + ", which " + other.given +
                                        (other.derived ? " also " : " ") + (other.written ? "writes" : "reads") +
                                        ": choose another name");
        }
    }
}

}  // namespace haptic
