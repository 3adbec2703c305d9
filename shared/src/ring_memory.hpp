// The memory of a ring and the wait-free protocol on it, apart from where that memory comes from.
//
// Every store to shared memory is a release store and every load an acquire load. A release store is seen after all
// that its writer stored before it, and an acquire load is made before all that its reader loads after it. There is one
// writer and the reader stores nothing that the protocol looks at, so the reader sees the writer's stores in the order
// in which they stand below: interleaving the two programs statement by statement, as tests/models/ring.pml does,
// covers every behaviour. On x86 these are plain moves.
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
/// No ring comes here by counting (146 years at a frame a nanosecond): a head beyond it is damage. Stamps are twice a
/// sequence and stay clear of overflow.
inline constexpr std::uint64_t kLastSequence = std::uint64_t{1} << 62;

using SharedWord = std::atomic<std::uint64_t>;
static_assert(SharedWord::is_always_lock_free && sizeof(SharedWord) == sizeof(std::uint64_t));
static_assert(std::atomic<std::uint32_t>::is_always_lock_free);

/// What the segment is. Never changes once magic is there; magic is stored last.
struct alignas(kCacheLine) RingIdentity {
    SharedWord magic;
    std::atomic<std::uint32_t> abi;
    std::atomic<std::uint32_t> kind;
    std::atomic<std::uint32_t> slot_bytes;
    std::atomic<std::uint32_t> slot_count;
};

/// Who is there, as each said on coming and going. The locks decide; this is for messages and for the other side.
struct alignas(kCacheLine) RingPresence {
    SharedWord session;
    std::atomic<std::uint32_t> writer_pid;
    std::atomic<std::uint32_t> reader_pid;
    std::atomic<std::uint32_t> closed;
};

/// What changes with each frame, together on one line: it crosses between the cores once.
struct alignas(kCacheLine) RingProgress {
    std::atomic<std::int64_t> heartbeat_ns;
    SharedWord head;  // sequence of the newest complete frame, 0 before the first
};

/// The first bytes of a segment.
struct RingHeader {
    RingIdentity identity;
    RingPresence presence;
    RingProgress progress;
};
static_assert(sizeof(RingHeader) == 3 * kCacheLine && offsetof(RingHeader, presence) == kCacheLine &&
              offsetof(RingHeader, progress) == 2 * kCacheLine);

/// What precedes the words of each slot.
struct RingSlotHeader {
    SharedWord stamp;  // 2n-1 while frame n is being written, 2n when it is complete, 0 before the first
    SharedWord words;  // how many words frame n has
};
static_assert(sizeof(RingSlotHeader) == 16);

/// A ring in memory that somebody else owns. Copies refer to the same ring.
class RingMemory {
  public:
    /// Bytes of a ring for slots of that size, a multiple of 8.
    [[nodiscard]] static std::size_t bytes(std::size_t slot_bytes) noexcept {
        return sizeof(RingHeader) + kRingSlots * stride(slot_bytes);
    }

    /// The memory is aligned to a cache line and has bytes(slot_bytes) bytes: zeros, or a ring of the same layout.
    RingMemory(void* memory, std::size_t slot_bytes) noexcept
        : base_(static_cast<std::byte*>(memory)), slot_bytes_(slot_bytes) {}

    /// Makes a ring of zeros.
    void initialise(RingKind kind) const noexcept;

    [[nodiscard]] RingHeader& header() const HAPTIC_RT { return *reinterpret_cast<RingHeader*>(base_); }

    [[nodiscard]] RingPeer peer() const HAPTIC_RT;

    /// Publishes frame `sequence`, which is header().head + 1. `bytes` is a multiple of 8, at most the slot's size.
    void publish(std::uint64_t sequence, const void* frame, std::size_t bytes, std::int64_t now_ns) const HAPTIC_RT;

    /// Copies one frame if its slot has it, whole; `frame` is unspecified otherwise. `sequence` is from 1 to
    /// kLastSequence. Loads only: the memory may be mapped without the right to write.
    [[nodiscard]] bool read(std::uint64_t sequence, void* frame) const HAPTIC_RT;

    struct Read {
        std::uint64_t sequence = 0;   // 0: nothing newer, or overtaken at each attempt
        std::uint64_t overtaken = 0;  // attempts that the writer spoiled
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
