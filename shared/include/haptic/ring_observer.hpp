// Looks on at a ring without being its reader: takes no role, holds no lock, maps the segment without the right to
// write, and sees what is published slot by slot rather than the newest alone.
//
// A ring keeps its last kRingSlots slots, so that at 1 kHz whoever wants to see all of them looks every few
// milliseconds; what was overwritten before is counted, never guessed at. The segment need not be there: one that
// comes, goes, or is made anew under the same name is found at the next attend(). It is checked as by a reader, and
// nothing in it is trusted afterwards: a slot is returned whole or not at all (ring.hpp), its content is unchecked.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "haptic/ring.hpp"

namespace haptic {

/// For how long an observer does not look whether its segment is still the right one.
inline constexpr std::int64_t kRingAttendNs = 250'000'000;

/// Counters of an observer.
struct RingObserveCounts {
    std::uint64_t slots = 0;     // returned
    std::uint64_t missed = 0;    // published since we attached to the segment, but overwritten before we looked
    std::uint64_t segments = 0;  // attached to, one after the other
};

namespace detail {
class ObservedSegment;  // src/ring_observer.cpp: a checked, read-only mapping

class RingObserverBase {
  public:
    /// Finds the segment if there is one, and follows when it was made anew; asks the system every kRingAttendNs at
    /// most. What is still in the segment before is lost: take it first. `now_ns` never falls.
    void attend(std::int64_t now_ns);
    [[nodiscard]] bool attached() const noexcept { return segment_ != nullptr; }
    /// Why the segment that is there cannot be looked at, as a RingError says it; empty if it can, or there is none.
    [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

    /// What the writer says of itself; zeros while not attached.
    [[nodiscard]] RingPeer peer() const noexcept;
    /// Whether a process has the writer's role, by its lock: also one that is stopped. A system call.
    [[nodiscard]] bool has_writer() const noexcept;
    [[nodiscard]] RingObserveCounts counts() const noexcept { return counts_; }

    RingObserverBase(RingObserverBase&&) noexcept;
    RingObserverBase& operator=(RingObserverBase&&) noexcept;
    ~RingObserverBase();

  protected:
    RingObserverBase(const std::string& session, RingKind kind, std::size_t slot_bytes);
    bool next_bytes(void* slot) noexcept;

  private:
    void find_segment();
    void leave() noexcept;

    std::string session_;
    RingKind kind_;
    std::size_t slot_bytes_;
    std::unique_ptr<ObservedSegment> segment_;
    std::string problem_;
    std::int64_t attend_at_ns_ = 0;
    std::uint64_t last_ = 0;  // sequence up to which all was returned or missed
    RingObserveCounts counts_;
};
}  // namespace detail

/// Slot is ContactFrame or DeviceState.
template <class Slot>
class RingObserver : public detail::RingObserverBase {
  public:
    /// Attaches to nothing yet: see attend(). Throws RingError::Kind::BadSessionName.
    explicit RingObserver(const std::string& session)
        : RingObserverBase(session, detail::kRingKind<Slot>, sizeof(Slot)) {}

    /// Copies the oldest slot that is there and was not returned before; `out` is unspecified if there is none. Of a
    /// segment that was there before us, this begins with the oldest that it still has. kRingSlots copies at most.
    [[nodiscard]] bool next(Slot& out) noexcept { return next_bytes(&out); }
};

}  // namespace haptic
