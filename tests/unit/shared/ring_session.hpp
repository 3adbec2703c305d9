// A session of a test of the ring, and removal of its segments.
#pragma once

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstddef>
#include <stdexcept>
#include <string>

#include "haptic/ring.hpp"
#include "unique_session.hpp"

namespace haptic::test {

/// A session used only by this test; removes its segments.
class RingSession {
  public:
    RingSession() = default;
    RingSession(const RingSession&) = delete;
    RingSession& operator=(const RingSession&) = delete;
    ~RingSession() {
        remove(RingKind::Contact);
        remove(RingKind::State);
    }

    [[nodiscard]] const std::string& name() const noexcept { return name_; }
    [[nodiscard]] std::string path(RingKind kind) const { return "/dev/shm" + ring_segment_name(name_, kind); }
    [[nodiscard]] bool exists(RingKind kind) const {
        struct stat status{};
        return lstat(path(kind).c_str(), &status) == 0;
    }

    /// Opens the segment as a file, to corrupt it.
    [[nodiscard]] int open(RingKind kind, int flags, mode_t mode = 0600) const {
        const int fd = shm_open(ring_segment_name(name_, kind).c_str(), flags, mode);
        if (fd < 0) {
            throw std::runtime_error("cannot open " + path(kind));
        }
        return fd;
    }
    void write(RingKind kind, std::size_t offset, const void* bytes, std::size_t count) const {
        const int fd = open(kind, O_RDWR);
        const bool whole = pwrite(fd, bytes, count, static_cast<off_t>(offset)) == static_cast<ssize_t>(count);
        close(fd);
        if (!whole) {
            throw std::runtime_error("cannot write " + path(kind));
        }
    }
    void resize(RingKind kind, std::size_t bytes) const {
        const int fd = open(kind, O_RDWR);
        const bool done = ftruncate(fd, static_cast<off_t>(bytes)) == 0;
        close(fd);
        if (!done) {
            throw std::runtime_error("cannot resize " + path(kind));
        }
    }
    void remove(RingKind kind) const { shm_unlink(ring_segment_name(name_, kind).c_str()); }

  private:
    std::string name_ = unique_session();
};

}  // namespace haptic::test
