#include "ring_memory.hpp"

#include <algorithm>
#include <cstring>

namespace haptic::detail {
namespace {

constexpr auto kAcquire = std::memory_order_acquire;
constexpr auto kRelease = std::memory_order_release;

SharedWord* words_of(RingSlotHeader& slot) HAPTIC_RT {
    return reinterpret_cast<SharedWord*>(&slot + 1);
}

}  // namespace

void RingMemory::initialise(RingKind kind) const noexcept {
    // `magic` last, with release: a process that acquires it sees all other fields.
    RingHeader& ring = header();
    ring.identity.abi.store(HAPTIC_ABI_VERSION, kRelease);
    ring.identity.kind.store(static_cast<std::uint32_t>(kind), kRelease);
    ring.identity.slot_bytes.store(static_cast<std::uint32_t>(slot_bytes_), kRelease);
    ring.identity.slot_count.store(kRingSlots, kRelease);
    ring.identity.magic.store(kRingMagic, kRelease);
}

RingPeer RingMemory::peer() const HAPTIC_RT {
    const RingHeader& ring = header();
    RingPeer peer;
    peer.session = ring.presence.session.load(kAcquire);
    peer.heartbeat_ns = ring.progress.heartbeat_ns.load(kAcquire);
    peer.writer_pid = ring.presence.writer_pid.load(kAcquire);
    peer.closed = ring.presence.closed.load(kAcquire) != 0;
    return peer;
}

RingSlotHeader& RingMemory::slot_of(std::uint64_t sequence) const HAPTIC_RT {
    const std::size_t offset = sizeof(RingHeader) + (sequence % kRingSlots) * stride(slot_bytes_);
    return *reinterpret_cast<RingSlotHeader*>(base_ + offset);
}

void RingMemory::publish(std::uint64_t sequence, const void* frame, std::size_t bytes,
                         std::int64_t now_ns) const HAPTIC_RT {
    RingSlotHeader& slot = slot_of(sequence);
    SharedWord* const words = words_of(slot);
    const auto* const source = static_cast<const std::byte*>(frame);
    const std::size_t count = std::min(bytes, slot_bytes_) / sizeof(std::uint64_t);

    // 1. Mark the slot as incomplete. A reader that later acquires any of the words below sees this stamp or a later
    // one
    //    in its second check, and rejects its copy.
    slot.stamp.store(2 * sequence - 1, kRelease);
    slot.words.store(count, kRelease);
    // 2. The words. Release stores, so that none becomes visible before the odd stamp.
    for (std::size_t i = 0; i < count; ++i) {
        std::uint64_t word = 0;
        std::memcpy(&word, source + i * sizeof word, sizeof word);
        words[i].store(word, kRelease);
    }
    // 3. Mark the slot as complete: a reader that acquires this stamp sees all words of the frame.
    slot.stamp.store(2 * sequence, kRelease);
    // 4. Announce it. `head` comes last: a reader that acquires it finds a complete slot, unless the writer has wrapped
    // around
    //    since, and a heartbeat at least as recent.
    header().progress.heartbeat_ns.store(now_ns, kRelease);
    header().progress.head.store(sequence, kRelease);
}

bool RingMemory::read(std::uint64_t sequence, void* frame) const HAPTIC_RT {
    auto* const target = static_cast<std::byte*>(frame);
    RingSlotHeader& slot = slot_of(sequence);
    const SharedWord* const words = words_of(slot);
    // Complete and of this frame? Acquire: the words below are loaded after this check.
    if (slot.stamp.load(kAcquire) != 2 * sequence) {
        return false;
    }
    // The count may belong to a later frame or be corrupt: clamp it, so that no access leaves the slot.
    const std::uint64_t count = std::min<std::uint64_t>(slot.words.load(kAcquire), slot_bytes_ / sizeof(std::uint64_t));
    for (std::size_t i = 0; i < count; ++i) {
        const std::uint64_t word = words[i].load(kAcquire);
        std::memcpy(target + i * sizeof word, &word, sizeof word);
    }
    // Still unchanged? Each word was acquired, so a copy with a word of a later frame finds a later stamp here.
    return slot.stamp.load(kAcquire) == 2 * sequence;
}

RingMemory::Read RingMemory::read_newest(std::uint64_t last, void* frame) const HAPTIC_RT {
    Read result;
    for (int attempt = 0; attempt < kRingReadAttempts; ++attempt) {
        // Acquire: pairs with the release store of head in publish().
        const std::uint64_t newest = header().progress.head.load(kAcquire);
        if (newest <= last || newest > kLastSequence) {
            return result;
        }
        if (read(newest, frame)) {
            result.sequence = newest;
            return result;
        }
        // The writer wrapped around during the copy: retry with the frame that is now the newest.
        ++result.overtaken;
    }
    return result;
}

}  // namespace haptic::detail
