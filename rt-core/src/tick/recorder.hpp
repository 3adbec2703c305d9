// Storage of tick records: a black box of the last seconds, and a queue to the thread that writes a recording. All
// memory is allocated by the constructors.
#pragma once

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"
#include "tick/tick_record.hpp"

namespace haptic::rt {

/// Ring buffer of the last N ticks, in memory of its own or of a file that outlives the process. For one thread.
class BlackBox {
  public:
    explicit BlackBox(std::size_t capacity);
    /// Reads what a process has left that did not come to an end. Throws std::runtime_error if the memory, which must
    /// outlive the box, is not a black box of this version.
    explicit BlackBox(std::span<std::byte> left);
    BlackBox(const BlackBox&) = delete;
    BlackBox& operator=(const BlackBox&) = delete;

    /// Moves to other memory of at least bytes(capacity), aligned as new, which must outlive the box. Drops the ticks.
    void store_in(std::span<std::byte> memory);
    [[nodiscard]] static std::size_t bytes(std::size_t capacity) noexcept;
    [[nodiscard]] std::size_t capacity() const HAPTIC_RT { return capacity_; }

    void push(const TickRecord& record) HAPTIC_RT;
    [[nodiscard]] std::size_t size() const HAPTIC_RT;
    /// Oldest first; index below size().
    [[nodiscard]] const TickRecord& at(std::size_t index) const HAPTIC_RT;
    /// Time of the first tick that armed, whether or not it is still kept; of the oldest tick if none did.
    [[nodiscard]] std::int64_t start_ns() const HAPTIC_RT;

  private:
    struct Head {
        std::uint64_t magic = 0;
        std::uint32_t layout = 0;        // of the records: another build may have another one
        std::uint32_t record_bytes = 0;  // sizeof(TickRecord)
        std::uint64_t capacity = 0;      // records that follow
        std::atomic<std::uint64_t> pushed{0};
        std::int64_t armed_ns = 0;  // 0: not yet
    };

    std::vector<std::byte> own_;
    Head* head_ = nullptr;
    TickRecord* records_ = nullptr;
    std::size_t capacity_ = 0;
    std::size_t torn_ = 0;  // 1 if the oldest record may be half overwritten
};

/// Single-producer single-consumer queue. Wait-free on both sides; entries that find it full are dropped and counted.
template <class Entry>
class SpscQueue {
  public:
    /// The capacity is rounded up to a power of two, so that indices may wrap.
    explicit SpscQueue(std::size_t capacity) : entries_(std::bit_ceil(std::max<std::size_t>(capacity, 2))) {}

    /// Producer: the slot of the next entry, to be passed on by commit(); nullptr if the queue is full.
    Entry* claim() HAPTIC_RT {
        const std::uint64_t head = head_.load(std::memory_order_relaxed);  // only this thread writes it
        // acquire: the consumer has finished reading the slots that it released.
        if (head - tail_.load(std::memory_order_acquire) == entries_.size()) {
            dropped_.fetch_add(1, std::memory_order_relaxed);
            return nullptr;
        }
        return &entries_[head & (entries_.size() - 1)];
    }
    void commit() HAPTIC_RT {
        // release: the entry becomes visible before the index.
        head_.store(head_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
    }

    /// Consumer: the oldest entry, to be freed by release(); nullptr if the queue is empty.
    const Entry* front() HAPTIC_RT {
        const std::uint64_t tail = tail_.load(std::memory_order_relaxed);  // only this thread writes it
        return tail == head_.load(std::memory_order_acquire) ? nullptr : &entries_[tail & (entries_.size() - 1)];
    }
    void release() HAPTIC_RT { tail_.store(tail_.load(std::memory_order_relaxed) + 1, std::memory_order_release); }

    [[nodiscard]] std::uint64_t dropped() const HAPTIC_RT { return dropped_.load(std::memory_order_relaxed); }

  private:
    // Separate cache lines for what the two threads write, to avoid false sharing.
    alignas(64) std::atomic<std::uint64_t> tail_{0};  // next to be read; written by the consumer
    alignas(64) std::atomic<std::uint64_t> head_{0};  // next to be written; written by the producer
    std::atomic<std::uint64_t> dropped_{0};           // written by the producer
    std::vector<Entry> entries_;
};

/// Contact frame as a tick found it in the ring.
struct RecordedFrame {
    std::int64_t now_ns = 0;                 // time of the tick that took it
    FrameDefect defect = FrameDefect::None;  // why it was rejected
    ContactFrame frame{};                    // proxies from proxy_count on are undefined
};

/// Queues of tick records and of the frames that they took, from the tick to a writing thread.
class Recorder {
  public:
    explicit Recorder(std::size_t tick_capacity, std::size_t frame_capacity = 64);

    /// By the tick.
    void push(const TickRecord& record) HAPTIC_RT;
    /// By the tick. Copies only the used part of the frame.
    void push(std::int64_t now_ns, FrameDefect defect, const ContactFrame& frame) HAPTIC_RT;
    /// By the writing thread. Returns false if the queue is empty.
    bool pop(TickRecord& record) HAPTIC_RT;
    [[nodiscard]] SpscQueue<RecordedFrame>& frames() HAPTIC_RT { return frames_; }

    /// Ticks dropped because the queue was full: drain more often, or raise the capacity.
    [[nodiscard]] std::uint64_t dropped() const HAPTIC_RT { return ticks_.dropped(); }
    [[nodiscard]] std::uint64_t frames_dropped() const HAPTIC_RT { return frames_.dropped(); }

  private:
    SpscQueue<TickRecord> ticks_;
    SpscQueue<RecordedFrame> frames_;
};

}  // namespace haptic::rt
