#include <haptic/device/variant_writer.hpp>

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <stdexcept>
#include <string>
#include <system_error>

#include <haptic/device/variant_file.hpp>

namespace haptic::device {
namespace {

constexpr int kMostBackups = 10'000;

[[noreturn]] void fail(const std::filesystem::path& file, const std::string& what, int error) {
    throw std::runtime_error(file.string() + ": " + what + ": " + std::generic_category().message(error));
}

/// A file that is removed again unless it was renamed.
class Temporary {
  public:
    explicit Temporary(std::filesystem::path path) : path_(std::move(path)) {}
    Temporary(const Temporary&) = delete;
    Temporary& operator=(const Temporary&) = delete;
    ~Temporary() {
        if (fd_ >= 0) {
            ::close(fd_);
        }
        ::unlink(path_.c_str());  // fails where it was renamed
    }

    /// On the disk when it returns. 0, or the error.
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

/// A second name for what is in the file now; no file of that name is ever replaced.
std::filesystem::path keep(const std::filesystem::path& file) {
    for (int number = 1; number <= kMostBackups; ++number) {
        std::filesystem::path backup = file;
        backup += ".bak-" + std::to_string(number);
        if (::link(file.c_str(), backup.c_str()) == 0) {
            return backup;
        }
        if (errno == EEXIST) {
            continue;
        }
        // A file system without links: a copy, which refuses to replace a file too.
        std::error_code error;
        if (std::filesystem::copy_file(file, backup, std::filesystem::copy_options::none, error)) {
            return backup;
        }
        if (error != std::errc::file_exists) {
            fail(file, "cannot be kept as " + backup.string(), error.value());
        }
    }
    fail(file, "has too many backups", EEXIST);
}

}  // namespace

std::optional<std::filesystem::path> write_variant(const std::filesystem::path& file, const Variant& variant,
                                                   std::string_view comment) {
    const bool exists = std::filesystem::exists(file);
    if (exists && !std::filesystem::is_regular_file(file)) {
        throw std::runtime_error(file.string() + ": is not a plain file");
    }
    const std::string text = to_toml(variant, comment);
    std::filesystem::path beside = file;
    beside += ".part-" + std::to_string(::getpid());
    Temporary temporary(std::move(beside));
    if (const int error = temporary.write(text); error != 0) {
        fail(file, "cannot be written", error);
    }
    if (load_variant(temporary.path()) != variant) {
        throw std::runtime_error(file.string() + ": what was written is not what was meant; the old file stands");
    }
    std::optional<std::filesystem::path> backup;
    if (exists) {
        backup = keep(file);
    }
    if (::rename(temporary.path().c_str(), file.c_str()) != 0) {
        fail(file, "cannot be replaced", errno);
    }
    return backup;
}

}  // namespace haptic::device
