#include "process/idle_request.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cstdint>

namespace haptic::rt {

IdleRequest::IdleRequest(int exit_us, const std::filesystem::path& file) {
    if (exit_us < 0) {
        return;
    }
    const int fd = open(file.c_str(), O_WRONLY | O_CLOEXEC | O_NOFOLLOW);
    const std::int32_t value = exit_us;
    if (fd >= 0 && write(fd, &value, sizeof value) == static_cast<ssize_t>(sizeof value)) {
        fd_ = fd;
    } else if (fd >= 0) {
        close(fd);
    }
}

IdleRequest::~IdleRequest() {
    if (fd_ >= 0) {
        close(fd_);
    }
}

}  // namespace haptic::rt
