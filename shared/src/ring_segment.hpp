// Ring segment: creates, checks, locks and maps the shared memory of a ring; the last process to leave removes it.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>

#include "haptic/ring.hpp"
#include "ring_memory.hpp"
#include "segment_checks.hpp"

namespace haptic::detail {

class RingSegment {
  public:
    /// Attaches in a role; creates or repairs the segment if necessary. Throws RingError.
    RingSegment(const std::string& session, RingKind kind, std::size_t slot_bytes, RingLock role);
    RingSegment(const RingSegment&) = delete;
    RingSegment& operator=(const RingSegment&) = delete;
    /// Releases the role; removes the segment if the other role is free.
    ~RingSegment();

    [[nodiscard]] const RingMemory& memory() const HAPTIC_RT { return memory_; }

  private:
    [[nodiscard]] Descriptor open_and_lock() const;
    void make_valid(int fd) const;
    void create(int fd) const;
    void take_role(int fd) const;
    [[nodiscard]] void* map(int fd) const;
    [[nodiscard]] std::atomic<std::uint32_t>& own_pid() const noexcept;

    SegmentChecks checks_;
    RingLock role_;
    Descriptor fd_;
    RingMemory memory_{nullptr, 0};
};

}  // namespace haptic::detail
