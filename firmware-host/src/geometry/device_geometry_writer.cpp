#include "haptic/device/device_geometry_writer.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <stdexcept>
#include <string>
#include <system_error>

#include "haptic/device/device_geometry_file.hpp"

namespace haptic::device {
namespace {

constexpr int kMaxBackups = 10'000;

[[noreturn]] void fail(const std::filesystem::path& file, const std::string& what, int error) {
    throw std::runtime_error(file.string() + ": " + what + ": " + std::generic_category().message(error));
}

/// A temporary file, removed unless it was renamed.
class Temporary {
  public:
    explicit Temporary(std::filesystem::path path) : path_(std::move(path)) {}
    Temporary(const Temporary&) = delete;
    Temporary& operator=(const Temporary&) = delete;
    ~Temporary() {
        if (fd_ >= 0) {
            ::close(fd_);
        }
        ::unlink(path_.c_str());  // fails if it was renamed
    }

    /// Creates the file and writes it to disk (fsync). Returns 0 or an errno.
    int write(const std::string& text) {
        fd_ = ::open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
        if (fd_ < 0) {
            return errno;
        }
        for (std::size_t done = 0; done < text.size();) {
            const ssize_t count = ::write(fd_, text.data() + done, text.size() - done);
            if (count < 0 && errno != EINTR) {
                return errno;
            }
            done += count > 0 ? static_cast<std::size_t>(count) : 0;
        }
        return ::fsync(fd_) == 0 ? 0 : errno;
    }
    [[nodiscard]] const std::filesystem::path& path() const { return path_; }

  private:
    std::filesystem::path path_;
    int fd_ = -1;
};

/// Backs up the present contents under the first free name file.bak-N; never replaces a file.
std::filesystem::path back_up(const std::filesystem::path& file) {
    for (int number = 1; number <= kMaxBackups; ++number) {
        std::filesystem::path backup = file;
        backup += ".bak-" + std::to_string(number);
        if (::link(file.c_str(), backup.c_str()) == 0) {
            return backup;
        }
        if (errno == EEXIST) {
            continue;
        }
        // A file system without hard links: copy, which does not replace a file either.
        std::error_code error;
        if (std::filesystem::copy_file(file, backup, std::filesystem::copy_options::none, error)) {
            return backup;
        }
        if (error != std::errc::file_exists) {
            fail(file, "cannot be backed up as " + backup.string(), error.value());
        }
    }
    fail(file, "has too many backups", EEXIST);
}

}  // namespace

std::optional<std::filesystem::path> write_device_geometry(const std::filesystem::path& file,
                                                           const DeviceGeometry& geometry, std::string_view comment) {
    const bool exists = std::filesystem::exists(file);
    if (exists && !std::filesystem::is_regular_file(file)) {
        throw std::runtime_error(file.string() + ": is not a regular file");
    }
    // Write next to the file, on the same file system, so that rename() is atomic.
    const std::string text = to_toml(geometry, comment);
    std::filesystem::path beside = file;
    beside += ".part-" + std::to_string(::getpid());
    Temporary temporary(std::move(beside));
    if (const int error = temporary.write(text); error != 0) {
        fail(file, "cannot be written", error);
    }
    // Verify by reading it back.
    if (load_device_geometry(temporary.path()) != geometry) {
        throw std::runtime_error(file.string() +
                                 ": the written file reads back differently; the old file is unchanged");
    }
    std::optional<std::filesystem::path> backup;
    if (exists) {
        backup = back_up(file);
    }
    if (::rename(temporary.path().c_str(), file.c_str()) != 0) {
        fail(file, "cannot be replaced", errno);
    }
    return backup;
}

}  // namespace haptic::device
