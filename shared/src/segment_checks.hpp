// What a ring's segment is called and must be: the refusals that its two ends and its observers share.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "haptic/ring.hpp"
#include "ring_memory.hpp"

namespace haptic::detail {

/// The byte of the segment on which a process holds an open-file-description lock for as long as it has that part.
enum class RingLock : std::uint8_t {
    Writer = 0,
    Reader = 1,
    Change = 2  // held while a segment is created, checked or removed, never longer
};

/// Whether another open file holds any of `count` bytes from this one on. The descriptor may be read-only.
[[nodiscard]] bool is_held_by_another(int fd, RingLock byte, std::int64_t count);

/// A file descriptor that closes itself, and with it gives back every lock that it holds.
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

/// One segment's name and layout. Every refusal is a RingError that says which segment, what is wrong, and what to do.
class SegmentChecks {
  public:
    /// Throws RingError::Kind::BadSessionName.
    SegmentChecks(const std::string& session, RingKind kind, std::size_t slot_bytes);

    [[nodiscard]] const std::string& name() const noexcept { return name_; }
    [[nodiscard]] const std::string& session() const noexcept { return session_; }
    [[nodiscard]] RingKind kind() const noexcept { return kind_; }
    [[nodiscard]] std::size_t slot_bytes() const noexcept { return slot_bytes_; }
    /// "; end what uses session ..., then: rm ...", to end a message with.
    [[nodiscard]] std::string removal() const;

    /// That shm_open failed with this error.
    [[noreturn]] void refuse_unopened(int error) const;
    /// A file of another user, one that others may open, or no plain file.
    void refuse_foreign(int fd) const;
    /// Copies what the segment begins with. The size is that of the file.
    void read_header(int fd, std::size_t size, void* header) const;
    /// A ring of another kind, release or size, or a damaged one.
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
