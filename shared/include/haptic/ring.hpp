// The ring that joins the two processes: POSIX shared memory, one writer, one reader, the newest slot wins.
//
// A ring is a segment /dev/shm/haptic-<uid>-<session>-<kind>, mode 0600, with a header and kRingSlots slots. Whichever
// process comes first creates it; either may die at any instant, also in the middle of a slot, and come back, and the
// other keeps its mapping: a restarted writer takes over the same segment and the same sequence of numbers, under a new
// session id. The roles are open-file-description locks on the segment (one byte for the writer, one for the reader),
// so the kernel gives a role back when its process ends, however it ends. The last to leave removes the segment.
//
// Slots are seqlocks. Frame n goes to slot n mod kRingSlots, whose stamp is 2n-1 while it is being written and 2n when
// it is complete. The writer fills the slot that is farthest from the newest one and then moves `head`; a reader that
// was overtaken while it copied sees the stamp changed and tries again with the newest, kRingReadAttempts times at
// most. So neither side ever waits for the other, and no torn frame is ever returned. A writer that takes over goes on
// at head + 1: it writes the frame at which its predecessor died anew, which no reader can have looked at. Words are
// copied with release stores and acquire loads rather than fences (Boehm 2012, "Can seqlocks get along with programming
// language memory models?"), which costs nothing on x86 and lets ThreadSanitizer see the protocol. Only the part of a
// frame that is in use is copied. tests/models/ring.pml is the same protocol for Spin.
//
// The segment is never trusted after attach: sizes and counts used for addressing are our own constants. What it cannot
// withstand is its own user: a process of the same user that truncates the segment under us is a bus error. A process
// that forks without exec shares its roles with the child until both have ended.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>

#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"

namespace haptic {

inline constexpr std::uint32_t kRingSlots = 8;
inline constexpr int kRingReadAttempts = 4;

/// A ring could not be attached. what() says which segment, what is wrong with it, and what to do.
class RingError : public std::runtime_error {
  public:
    enum class Kind : std::uint8_t {
        BadSessionName,  // not [A-Za-z0-9_-]{1,64}
        RoleTaken,       // another live process has this role in this session
        Foreign,         // segment belongs to another user, is open to others, or is not a plain segment
        BadMagic,
        BadAbi,
        BadSize,  // truncated, or slots of another size
        Damaged,  // its count of frames is beyond any that a ring can reach
        System    // a system call failed
    };
    RingError(Kind kind, const std::string& what) : std::runtime_error(what), kind_(kind) {}
    [[nodiscard]] Kind kind() const noexcept { return kind_; }

  private:
    Kind kind_;
};

/// Which of a session's two rings.
enum class RingKind : std::uint32_t {
    Contact = 1,  // ContactFrame, simulation to real-time process
    State = 2     // DeviceState, real-time process to simulation
};

/// What a reader can say of the writer. Each member is true of itself; around a restart they may be of two writers.
struct RingPeer {
    std::uint64_t session = 0;      // of the newest writer; 0 before the first
    std::int64_t heartbeat_ns = 0;  // when that writer last published or beat; 0 before it first did
    std::uint32_t writer_pid = 0;   // 0 when no writer is attached, as far as it said so itself
    bool closed = false;            // the writer left in an orderly way
};

/// Counters of a reader since it attached.
struct RingReadCounts {
    std::uint64_t frames = 0;     // returned
    std::uint64_t skipped = 0;    // published but overtaken by a newer one before we looked
    std::uint64_t overtaken = 0;  // attempts repeated because the writer came round while we copied
};

namespace detail {
class RingSegment;  // src/ring_segment.hpp: creation, checks, locks, mapping, removal

/// Slot-size-agnostic halves; the templates below give them a type.
class RingWriterBase {
  public:
    [[nodiscard]] std::uint64_t session_id() const noexcept { return session_; }
    /// Tells the reader that this writer is alive although it has nothing to publish. Wait-free.
    void beat(std::int64_t now_ns) HAPTIC_RT;

    RingWriterBase(RingWriterBase&&) noexcept;
    RingWriterBase& operator=(RingWriterBase&&) noexcept;
    ~RingWriterBase();

  protected:
    RingWriterBase(const std::string& session, RingKind kind, std::size_t slot_bytes);
    std::uint64_t publish_bytes(const void* frame, std::size_t bytes, std::int64_t now_ns) HAPTIC_RT;
    [[nodiscard]] std::uint64_t next_sequence() const HAPTIC_RT { return next_; }

  private:
    std::unique_ptr<RingSegment> segment_;
    std::uint64_t session_ = 0;
    std::uint64_t next_ = 1;
};

class RingReaderBase {
  public:
    [[nodiscard]] RingPeer peer() const HAPTIC_RT;
    [[nodiscard]] RingReadCounts counts() const HAPTIC_RT { return counts_; }

    RingReaderBase(RingReaderBase&&) noexcept;
    RingReaderBase& operator=(RingReaderBase&&) noexcept;
    ~RingReaderBase();

  protected:
    RingReaderBase(const std::string& session, RingKind kind, std::size_t slot_bytes);
    bool read_newest_bytes(void* frame) HAPTIC_RT;

  private:
    std::unique_ptr<RingSegment> segment_;
    std::uint64_t last_ = 0;
    RingReadCounts counts_;
};

template <class Slot>
struct RingKindOf;  // of no other slot
template <>
struct RingKindOf<ContactFrame> {
    static constexpr RingKind kKind = RingKind::Contact;
};
template <>
struct RingKindOf<DeviceState> {
    static constexpr RingKind kKind = RingKind::State;
};
template <class Slot>
inline constexpr RingKind kRingKind = RingKindOf<Slot>::kKind;

/// How much of a slot is in use, from its beginning: a contact frame ends with its last proxy.
inline std::size_t used_bytes(const ContactFrame& frame) HAPTIC_RT {
    return frame.proxy_count < kMaxProxies ? offsetof(ContactFrame, proxies) + frame.proxy_count * sizeof(ProxyContact)
                                           : sizeof(ContactFrame);
}
inline std::size_t used_bytes(const DeviceState& /*state*/) HAPTIC_RT {
    return sizeof(DeviceState);
}
}  // namespace detail

/// The writing end. Slot is ContactFrame or DeviceState.
template <class Slot>
class RingWriter : public detail::RingWriterBase {
    static_assert(sizeof(Slot) % sizeof(std::uint64_t) == 0 && std::is_trivially_copyable_v<Slot>);

  public:
    /// Attaches as the session's writer, creating the segment if there is none. Throws RingError.
    explicit RingWriter(const std::string& session) : RingWriterBase(session, detail::kRingKind<Slot>, sizeof(Slot)) {}

    /// Publishes a slot; fills in its sequence and session. Wait-free: one copy of the part in use. Returns the
    /// sequence.
    std::uint64_t publish(Slot& slot, std::int64_t now_ns) HAPTIC_RT {
        slot.sequence = next_sequence();
        slot.session = session_id();
        return publish_bytes(&slot, detail::used_bytes(slot), now_ns);
    }
};

/// The reading end.
template <class Slot>
class RingReader : public detail::RingReaderBase {
  public:
    /// Attaches as the session's reader, creating the segment if there is none. What was published before is not old to
    /// it: judge by the slot's time. Throws RingError.
    explicit RingReader(const std::string& session) : RingReaderBase(session, detail::kRingKind<Slot>, sizeof(Slot)) {}

    /// Copies the newest slot if there is one that was not returned before; `out` is unspecified otherwise. Proxies
    /// from proxy_count on are not written. Wait-free: kRingReadAttempts copies at most. The content is whole but
    /// unchecked: see find_defect().
    [[nodiscard]] bool read_newest(Slot& out) HAPTIC_RT { return read_newest_bytes(&out); }
};

/// The name of a ring's segment for shm_open, e.g. "/haptic-1000-default-contact".
/// Throws RingError::Kind::BadSessionName.
[[nodiscard]] std::string ring_segment_name(const std::string& session, RingKind kind);

}  // namespace haptic
