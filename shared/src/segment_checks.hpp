// Segment checks: the name of a ring's segment and its validation, shared by both ends and the observers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "haptic/ring.hpp"
#include "ring_memory.hpp"

namespace haptic::detail {

/// Byte of the segment on which a process holds an open-file-description lock while it has the role.
enum class RingLock : std::uint8_t {
    Writer = 0,
    Reader = 1,
    Change = 2  // held only while a segment is created, checked or removed
};

/// Whether another open file description locks any of `count` bytes starting at `byte`. The descriptor may be
/// read-only.
[[nodiscard]] bool is_held_by_another(int fd, RingLock byte, std::int64_t count);

/// Owning file descriptor. Closing it releases its locks.
class Descriptor {
  public:
    Descriptor() = default;
    explicit Descriptor(int fd) noexcept : fd_(fd) {}
    Descriptor(Descriptor&& other) noexcept;
    Descriptor& operator=(Descriptor&& other) noexcept;
    ~Descriptor();
    [[nodiscard]] int get() const noexcept { return fd_; }

  private:
    int fd_ = -1;
};

/// Name and expected layout of one segment. Every refusal throws a RingError with the segment, the problem and a
/// remedy.
class SegmentChecks {
  public:
    /// Throws RingError::Kind::BadSessionName.
    SegmentChecks(const std::string& session, RingKind kind, std::size_t slot_bytes);

    [[nodiscard]] const std::string& name() const noexcept { return name_; }
    [[nodiscard]] const std::string& session() const noexcept { return session_; }
    [[nodiscard]] RingKind kind() const noexcept { return kind_; }
    [[nodiscard]] std::size_t slot_bytes() const noexcept { return slot_bytes_; }
    /// End of a message: "; end the processes of session ..., then: rm ...".
    [[nodiscard]] std::string removal() const;

    /// Reports that shm_open failed with this errno.
    [[noreturn]] void refuse_unopened(int error) const;
    /// Refuses a file of another user, one that others can open, or one that is not a regular file.
    void refuse_foreign(int fd) const;
    /// Copies the header of a segment; `size` is the size of the file.
    void read_header(int fd, std::size_t size, void* header) const;
    /// Refuses a ring of another kind, ABI version or size, or a damaged one.
    void refuse_other_layout(const RingHeader& header, std::size_t size) const;

    [[noreturn]] void fail(RingError::Kind kind, const std::string& problem) const;
    [[noreturn]] void fail_system(const std::string& action, int error) const;

  private:
    std::string session_;
    std::string name_;
    RingKind kind_;
    std::size_t slot_bytes_;
};

}  // namespace haptic::detail
