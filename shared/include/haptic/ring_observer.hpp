// Ring observer: reads every slot of a ring without being its reader. It takes no role, holds no lock and maps the
// segment read-only.
//
// A ring keeps its last kRingSlots slots, so at 1 kHz an observer must read every few milliseconds to see all of them;
// slots that were overwritten before are counted as missed. The segment need not exist: attend() finds it when it is
// created, removed or replaced under the same name. It is checked as by a reader and not trusted afterwards: a slot is
// returned completely or not at all (ring.hpp), and its content is not validated.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "haptic/ring.hpp"

namespace haptic {

/// Interval at which an observer checks that its segment is still the current one.
inline constexpr std::int64_t kRingAttendNs = 250'000'000;

/// Counters of an observer.
struct RingObserveCounts {
    std::uint64_t slots = 0;     // returned
    std::uint64_t missed = 0;    // published since attaching to the segment, but overwritten before they were read
    std::uint64_t segments = 0;  // number of attachments
};

namespace detail {
class ObservedSegment;  // src/ring_observer.cpp: a checked, read-only mapping

class RingObserverBase {
  public:
    /// Attaches to the segment if it exists, and to its replacement if it was recreated; checks at most once per
    /// kRingAttendNs. Unread slots of a replaced segment are lost: read them first. `now_ns` must not decrease.
    void attend(std::int64_t now_ns);
    [[nodiscard]] bool attached() const noexcept { return segment_ != nullptr; }
    /// Why the existing segment cannot be observed, as in RingError::what(); empty otherwise.
    [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

    /// State of the writer; zeros while not attached.
    [[nodiscard]] RingPeer peer() const noexcept;
    /// Whether a process holds the writer's lock, even if it is stopped. One system call.
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
    std::uint64_t last_ = 0;  // all slots up to this sequence were returned or missed
    RingObserveCounts counts_;
};
}  // namespace detail

/// Slot is ContactFrame or DeviceState.
template <class Slot>
class RingObserver : public detail::RingObserverBase {
  public:
    /// Does not attach; see attend(). Throws RingError::Kind::BadSessionName.
    explicit RingObserver(const std::string& session)
        : RingObserverBase(session, detail::kRingKind<Slot>, sizeof(Slot)) {}

    /// Copies the oldest available slot that was not returned before; if there is none, returns false and `out` is
    /// unspecified. Of a segment that existed before, it starts with the oldest slot. At most kRingSlots copies.
    [[nodiscard]] bool next(Slot& out) noexcept { return next_bytes(&out); }
};

}  // namespace haptic
