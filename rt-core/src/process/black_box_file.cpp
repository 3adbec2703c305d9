#include "process/black_box_file.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "haptic/clock.hpp"
#include "haptic/types.hpp"

namespace haptic::rt {
namespace {

// Paths at the beginning of the file, each ended by a zero; the black box follows.
constexpr std::size_t kPathBytes = 2048;
constexpr std::size_t kHeadBytes = 2 * kPathBytes;
constexpr long kRetryNs = 10'000'000;

[[noreturn]] void fail(const std::filesystem::path& file, const std::string& problem) {
    throw std::runtime_error("black box " + file.string() + ": " + problem);
}

std::string reason(int error) {
    return std::system_category().message(error);
}

/// Closes the descriptor at the end of the scope unless it was released.
class Closing {
  public:
    explicit Closing(int descriptor) noexcept : descriptor_(descriptor) {}
    Closing(const Closing&) = delete;
    Closing& operator=(const Closing&) = delete;
    ~Closing() {
        if (descriptor_ >= 0) {
            close(descriptor_);
        }
    }
    [[nodiscard]] int get() const noexcept { return descriptor_; }
    int release() noexcept { return std::exchange(descriptor_, -1); }

  private:
    int descriptor_;
};

std::string path_at(std::span<const std::byte> head, std::size_t offset) {
    const auto* const text = reinterpret_cast<const char*>(head.data()) + offset;
    return {text, strnlen(text, kPathBytes)};
}

}  // namespace

std::filesystem::path BlackBoxFile::path_of(const std::string& session) {
    return "/dev/shm/haptic-" + std::to_string(geteuid()) + "-" + session + "-blackbox";
}

BlackBoxFile::BlackBoxFile(const std::string& session, std::size_t bytes, const std::filesystem::path& csv)
    : path_(path_of(session)), mapped_bytes_(kHeadBytes + bytes) {
    Closing file(open(path_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600));
    if (file.get() < 0) {
        fail(path_, "cannot be created: " + reason(errno));
    }
    // All of it now: a store to a page that cannot be had would be a SIGBUS.
    int error = flock(file.get(), LOCK_EX | LOCK_NB) == 0 ? 0 : errno;
    error = error != 0 ? error : posix_fallocate(file.get(), 0, static_cast<off_t>(mapped_bytes_));
    if (error == 0) {
        mapped_ = mmap(nullptr, mapped_bytes_, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, file.get(), 0);
        error = mapped_ == MAP_FAILED ? errno : 0;
    }
    if (error != 0) {
        unlink(path_.c_str());
        fail(path_, "its " + std::to_string(mapped_bytes_) + " bytes cannot be had: " + reason(error));
    }
    descriptor_ = file.release();
    const std::string target = std::filesystem::absolute(csv).string();
    std::memcpy(mapped_, target.data(), std::min(target.size(), kPathBytes - 1));
    std::memcpy(static_cast<char*>(mapped_) + kPathBytes, path_.c_str(),
                std::min(path_.native().size(), kPathBytes - 1));
}

BlackBoxFile::~BlackBoxFile() {
    remove();
    munmap(mapped_, mapped_bytes_);
    close(descriptor_);
}

std::span<std::byte> BlackBoxFile::memory() const noexcept {
    return {static_cast<std::byte*>(mapped_) + kHeadBytes, mapped_bytes_ - kHeadBytes};
}

void BlackBoxFile::remove() noexcept {
    if (!path_.empty()) {
        unlink(path_.c_str());
        path_.clear();
    }
}

LeftBlackBox read_left_black_box(int descriptor) {
    struct stat status{};
    if (fstat(descriptor, &status) != 0 || status.st_size < static_cast<off_t>(kHeadBytes)) {
        throw std::runtime_error("the black box that was left is empty");
    }
    std::vector<std::byte> content(static_cast<std::size_t>(status.st_size));
    std::size_t read = 0;
    while (read < content.size()) {
        const ssize_t count = pread(descriptor, content.data() + read, content.size() - read, static_cast<off_t>(read));
        if (count <= 0) {
            throw std::runtime_error("the black box that was left cannot be read: " + reason(count < 0 ? errno : EIO));
        }
        read += static_cast<std::size_t>(count);
    }
    LeftBlackBox left{.csv = path_at(content, 0), .file = path_at(content, kPathBytes), .memory = {}};
    left.memory.assign(content.begin() + kHeadBytes, content.end());
    return left;
}

std::optional<LeftBlackBox> read_left_black_box(const std::string& session, double max_wait_s) {
    const std::filesystem::path path = BlackBoxFile::path_of(session);
    const std::int64_t end_ns = monotonic_now_ns() + nanoseconds(max_wait_s);
    while (true) {
        const Closing file(open(path.c_str(), O_RDWR | O_NOFOLLOW | O_CLOEXEC));
        if (file.get() < 0) {
            if (errno == ENOENT) {
                return std::nullopt;  // none, or its guard has just saved it
            }
            fail(path, "cannot be opened: " + reason(errno));
        }
        if (flock(file.get(), LOCK_EX | LOCK_NB) == 0) {
            LeftBlackBox left = read_left_black_box(file.get());
            left.file = path;
            return left;
        }
        if (monotonic_now_ns() >= end_ns) {
            fail(path, "is in use by another process of this session");
        }
        const timespec wait{0, kRetryNs};
        nanosleep(&wait, nullptr);
    }
}

}  // namespace haptic::rt
