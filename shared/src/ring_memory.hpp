// Ring memory: the layout of a ring and the wait-free protocol on it, independent of how the memory was obtained.
//
// Every store to shared memory is a release store and every load an acquire load. A release store becomes visible after
// all earlier stores of its thread; an acquire load precedes all later loads of its thread. With a single writer, and a
// reader that stores nothing that the protocol reads, the reader observes the writer's stores in program order. The
// statement-by-statement interleavings of tests/models/ring.pml therefore cover every behaviour. On x86 these are plain
// moves.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "haptic/realtime.hpp"
#include "haptic/ring.hpp"

namespace haptic::detail {

inline constexpr std::size_t kCacheLine = 64;
inline constexpr std::uint64_t kRingMagic = 0x31474E5254504148;  // "HAPTRNG1" in little-endian memory
/// Unreachable by counting (146 years at one frame per nanosecond): a larger head means damage. Stamps, twice a
/// sequence, cannot overflow.
inline constexpr std::uint64_t kLastSequence = std::uint64_t{1} << 62;

using SharedWord = std::atomic<std::uint64_t>;
static_assert(SharedWord::is_always_lock_free && sizeof(SharedWord) == sizeof(std::uint64_t));
static_assert(std::atomic<std::uint32_t>::is_always_lock_free);

/// Identity of the segment. Constant once `magic` is set, which is stored last.
struct alignas(kCacheLine) RingIdentity {
    SharedWord magic;
    std::atomic<std::uint32_t> abi;
    std::atomic<std::uint32_t> kind;
    std::atomic<std::uint32_t> slot_bytes;
    std::atomic<std::uint32_t> slot_count;
};

/// Attached processes, as each stored it when it attached and detached. The locks are authoritative; this is for
/// messages and for the other end.
struct alignas(kCacheLine) RingPresence {
    SharedWord session;
    std::atomic<std::uint32_t> writer_pid;
    std::atomic<std::uint32_t> reader_pid;
    std::atomic<std::uint32_t> closed;
};

/// Fields that change with every frame, on one cache line, so that a single line moves between the cores.
struct alignas(kCacheLine) RingProgress {
    std::atomic<std::int64_t> heartbeat_ns;
    SharedWord head;  // sequence of the newest complete frame, 0 before the first
};

/// Header at the start of a segment.
struct RingHeader {
    RingIdentity identity;
    RingPresence presence;
    RingProgress progress;
};
static_assert(sizeof(RingHeader) == 3 * kCacheLine && offsetof(RingHeader, presence) == kCacheLine &&
              offsetof(RingHeader, progress) == 2 * kCacheLine);

/// Header of each slot, followed by its words.
struct RingSlotHeader {
    SharedWord stamp;  // 2n-1 while frame n is being written, 2n when it is complete, 0 before the first
    SharedWord words;  // number of words of frame n
};
static_assert(sizeof(RingSlotHeader) == 16);

/// View of a ring in memory owned by the caller. Copies refer to the same ring.
class RingMemory {
  public:
    /// Size of a ring, bytes. slot_bytes is a multiple of 8.
    [[nodiscard]] static std::size_t bytes(std::size_t slot_bytes) noexcept {
        return sizeof(RingHeader) + kRingSlots * stride(slot_bytes);
    }

    /// Memory of bytes(slot_bytes) bytes, aligned to a cache line: zeros, or a ring of the same layout.
    RingMemory(void* memory, std::size_t slot_bytes) noexcept
        : base_(static_cast<std::byte*>(memory)), slot_bytes_(slot_bytes) {}

    /// Initialises a ring in zeroed memory.
    void initialise(RingKind kind) const noexcept;

    [[nodiscard]] RingHeader& header() const HAPTIC_RT { return *reinterpret_cast<RingHeader*>(base_); }

    [[nodiscard]] RingPeer peer() const HAPTIC_RT;

    /// Publishes frame `sequence`, which must be head + 1. `bytes` is a multiple of 8 and at most the slot's size.
    void publish(std::uint64_t sequence, const void* frame, std::size_t bytes, std::int64_t now_ns) const HAPTIC_RT;

    /// Copies frame `sequence` (1..kLastSequence) if its slot holds it completely; otherwise returns false and `frame`
    /// is unspecified. Only loads: the memory may be mapped read-only.
    [[nodiscard]] bool read(std::uint64_t sequence, void* frame) const HAPTIC_RT;

    struct Read {
        std::uint64_t sequence = 0;   // 0: nothing newer, or overtaken in every attempt
        std::uint64_t overtaken = 0;  // attempts that failed because the writer overwrote the slot
    };
    /// Copies the newest frame if its sequence is above `last`.
    [[nodiscard]] Read read_newest(std::uint64_t last, void* frame) const HAPTIC_RT;

  private:
    [[nodiscard]] static std::size_t stride(std::size_t slot_bytes) noexcept {
        return (sizeof(RingSlotHeader) + slot_bytes + kCacheLine - 1) / kCacheLine * kCacheLine;
    }
    [[nodiscard]] RingSlotHeader& slot_of(std::uint64_t sequence) const HAPTIC_RT;

    std::byte* base_;
    std::size_t slot_bytes_;
};

}  // namespace haptic::detail
