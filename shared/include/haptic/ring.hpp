// Ring that connects the two processes: POSIX shared memory, one writer, one reader; the reader takes the newest slot.
//
// A ring is a segment /dev/shm/haptic-<uid>-<session>-<kind> with mode 0600, a header and kRingSlots slots. The process
// that comes first creates it. Either process may die at any time, even while writing a slot, and come back; the other
// keeps its mapping. A restarted writer takes over the same segment and continues the sequence numbers under a new
// session id. The roles are open-file-description locks on the segment (one byte for the writer, one for the reader),
// so the kernel releases a role however its process ends. The last process to leave removes the segment.
//
// Slots are seqlocks. Frame n goes to slot n mod kRingSlots, whose stamp is 2n-1 while it is written and 2n when it is
// complete. The writer fills the slot farthest from the newest one and then advances `head`. A reader that is overtaken
// while it copies sees that the stamp has changed and retries with the newest frame, at most kRingReadAttempts times.
// Neither side ever waits for the other, and no torn frame is returned. A writer that takes over continues at head + 1:
// it rewrites the frame during which its predecessor died, which no reader can have read. Words are copied with release
// stores and acquire loads instead of fences (Boehm 2012, "Can seqlocks get along with programming language memory
// models?"), which costs nothing on x86 and makes the protocol visible to ThreadSanitizer. Only the used part of a
// frame is copied. tests/models/ring.pml models the protocol for Spin.
//
// The segment is not trusted after attaching: sizes and counts used for addressing are compile-time constants. It
// cannot withstand its own user: if a process of the same user truncates the segment, access is a bus error. A process
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

/// A ring could not be attached. what() names the segment, the problem and a remedy.
class RingError : public std::runtime_error {
  public:
    enum class Kind : std::uint8_t {
        BadSessionName,  // not [A-Za-z0-9_-]{1,64}
        RoleTaken,       // another live process has this role in this session
        Foreign,         // segment belongs to another user, is accessible to others, or is not a regular file
        BadMagic,
        BadAbi,
        BadSize,  // truncated, or a different slot size
        Damaged,  // its frame counter has an impossible value
        System    // a system call failed
    };
    RingError(Kind kind, const std::string& what) : std::runtime_error(what), kind_(kind) {}
    [[nodiscard]] Kind kind() const noexcept { return kind_; }

  private:
    Kind kind_;
};

/// Selects one of a session's rings.
enum class RingKind : std::uint32_t {
    Contact = 1,  // ContactFrame, simulation to real-time process
    State = 2,    // DeviceState, real-time process to simulation
    Overlay = 3   // WrenchOverlay, a third program to the real-time process, which opens it only if its settings say so
};

/// State of the writer as the reader sees it. Each member is read separately: during a restart of the writer they may
/// describe two different writers.
struct RingPeer {
    std::uint64_t session = 0;      // of the latest writer; 0 before the first
    std::int64_t heartbeat_ns = 0;  // last publish() or beat() of that writer; 0 before the first
    std::uint32_t writer_pid = 0;   // as the writer itself stored it; 0 when none is attached
    bool closed = false;            // the writer detached in an orderly way
};

/// Counters of a reader since it attached.
struct RingReadCounts {
    std::uint64_t frames = 0;     // returned
    std::uint64_t skipped = 0;    // published, but replaced by a newer one before it was read
    std::uint64_t overtaken = 0;  // attempts repeated because the writer overwrote the slot during the copy
};

namespace detail {
class RingSegment;  // src/ring_segment.hpp: creation, checks, locks, mapping, removal

/// Untyped base classes of the two ends; the templates below add the slot type.
class RingWriterBase {
  public:
    [[nodiscard]] std::uint64_t session_id() const noexcept { return session_; }
    /// Signals to the reader that this writer is alive without publishing. Wait-free.
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
struct RingKindOf;  // defined only for the slot types
template <>
struct RingKindOf<ContactFrame> {
    static constexpr RingKind kKind = RingKind::Contact;
};
template <>
struct RingKindOf<DeviceState> {
    static constexpr RingKind kKind = RingKind::State;
};
template <>
struct RingKindOf<WrenchOverlay> {
    static constexpr RingKind kKind = RingKind::Overlay;
};
template <class Slot>
inline constexpr RingKind kRingKind = RingKindOf<Slot>::kKind;

/// Bytes in use at the start of a slot: a contact frame ends with its last compliance, or without any with its last
/// proxy.
inline std::size_t used_bytes(const ContactFrame& frame) HAPTIC_RT {
    if (frame.compliance_rows > 0) {
        const std::size_t rows =
            frame.compliance_rows < kMaxComplianceRows ? frame.compliance_rows : kMaxComplianceRows;
        const std::size_t bytes = offsetof(ContactFrame, compliance) + rows * (rows + 1) / 2 * sizeof(float);
        return (bytes + sizeof(std::uint64_t) - 1) / sizeof(std::uint64_t) * sizeof(std::uint64_t);
    }
    const std::size_t proxies = frame.proxy_count < kMaxProxies ? frame.proxy_count : kMaxProxies;
    return offsetof(ContactFrame, proxies) + proxies * sizeof(ProxyContact);
}
inline std::size_t used_bytes(const DeviceState& /*state*/) HAPTIC_RT {
    return sizeof(DeviceState);
}
inline std::size_t used_bytes(const WrenchOverlay& /*overlay*/) HAPTIC_RT {
    return sizeof(WrenchOverlay);
}
}  // namespace detail

/// Writer of a ring. Slot is ContactFrame, DeviceState or WrenchOverlay.
template <class Slot>
class RingWriter : public detail::RingWriterBase {
    static_assert(sizeof(Slot) % sizeof(std::uint64_t) == 0 && std::is_trivially_copyable_v<Slot>);

  public:
    /// Attaches as the session's writer and creates the segment if necessary. Throws RingError.
    explicit RingWriter(const std::string& session) : RingWriterBase(session, detail::kRingKind<Slot>, sizeof(Slot)) {}

    /// Publishes a slot and sets its sequence and session. Wait-free: one copy of the used part. Returns the sequence.
    std::uint64_t publish(Slot& slot, std::int64_t now_ns) HAPTIC_RT {
        slot.sequence = next_sequence();
        slot.session = session_id();
        return publish_bytes(&slot, detail::used_bytes(slot), now_ns);
    }
};

/// Reader of a ring.
template <class Slot>
class RingReader : public detail::RingReaderBase {
  public:
    /// Attaches as the session's reader and creates the segment if necessary. A slot published before counts as new:
    /// check its time. Throws RingError.
    explicit RingReader(const std::string& session) : RingReaderBase(session, detail::kRingKind<Slot>, sizeof(Slot)) {}

    /// Copies the newest slot if it was not returned before; otherwise returns false and `out` is unspecified. Proxies
    /// from index proxy_count on are not written. Wait-free: at most kRingReadAttempts copies. The slot is consistent
    /// but not validated: see find_defect().
    [[nodiscard]] bool read_newest(Slot& out) HAPTIC_RT { return read_newest_bytes(&out); }
};

/// Name of a ring's segment for shm_open, e.g. "/haptic-1000-default-contact".
/// Throws RingError::Kind::BadSessionName.
[[nodiscard]] std::string ring_segment_name(const std::string& session, RingKind kind);

}  // namespace haptic
