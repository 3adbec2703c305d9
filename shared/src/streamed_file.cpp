#include "haptic/streamed_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <stdexcept>

namespace haptic {

StreamedFile::StreamedFile(const std::filesystem::path& file) : file_(file) {
    constexpr mode_t everyone = 0666;  // before the umask
    descriptor_ = ::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, everyone);
    if (descriptor_ < 0) {
        throw std::runtime_error(file_.string() + ": cannot be written: " + std::generic_category().message(errno));
    }
}

StreamedFile::~StreamedFile() {
    if (descriptor_ >= 0) {
        (void)::close(descriptor_);
    }
}

/// Keeps the whole lines. Pipes and devices cannot be shortened; nobody reads them again.
void StreamedFile::end(std::string_view written, int error) noexcept {
    failure_ = {error, std::generic_category()};
    size_ += written.rfind('\n') + 1;  // npos + 1 is 0
    (void)!::ftruncate(descriptor_, static_cast<off_t>(size_));
}

bool StreamedFile::append(std::string_view lines) noexcept {
    if (failure_ || descriptor_ < 0) {
        return false;
    }
    for (std::string_view rest = lines; !rest.empty();) {
        const ssize_t written = ::write(descriptor_, rest.data(), rest.size());
        if (written < 0 && errno == EINTR) {
            continue;
        }
        if (written <= 0) {
            end(lines.substr(0, lines.size() - rest.size()), written < 0 ? errno : ENOSPC);
            return false;
        }
        rest.remove_prefix(static_cast<std::size_t>(written));
    }
    size_ += lines.size();
    return true;
}

void StreamedFile::close() {
    // Some file systems report a full disk only here.
    if (descriptor_ >= 0 && ::close(descriptor_) != 0 && !failure_) {
        failure_ = {errno, std::generic_category()};
    }
    descriptor_ = -1;
    if (failure_) {
        throw std::runtime_error(file_.string() + ": could not be written completely: " + failure_.message() +
                                 "; its first " + std::to_string(size_) + " bytes are kept");
    }
}

}  // namespace haptic
