// The shared-memory segment of a ring: created, checked, locked, mapped, and removed by the last to leave.
#pragma once

#include <atomic>
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

class RingSegment {
  public:
    /// Attaches in a role, creating or healing the segment where needed. Throws RingError.
    RingSegment(const std::string& session, RingKind kind, std::size_t slot_bytes, RingLock role);
    RingSegment(const RingSegment&) = delete;
    RingSegment& operator=(const RingSegment&) = delete;
    /// Gives the role back; removes the segment if the other role is free.
    ~RingSegment();

    [[nodiscard]] const RingMemory& memory() const HAPTIC_RT { return memory_; }

  private:
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

    [[nodiscard]] Descriptor open_and_lock() const;
    void refuse_foreign(int fd) const;
    void make_sound(int fd) const;
    void create(int fd) const;
    void take_role(int fd) const;
    [[nodiscard]] void* map(int fd) const;
    [[nodiscard]] std::atomic<std::uint32_t>& own_pid() const noexcept;
    [[noreturn]] void fail(RingError::Kind kind, const std::string& problem) const;
    [[noreturn]] void fail_system(const std::string& action, int error) const;
    [[nodiscard]] std::string removal() const;

    std::string session_;
    std::string name_;
    RingKind kind_;
    std::size_t slot_bytes_;
    RingLock role_;
    Descriptor fd_;
    RingMemory memory_{nullptr, 0};
};

}  // namespace haptic::detail
