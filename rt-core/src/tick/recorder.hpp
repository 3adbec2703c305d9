// Where ticks are kept: the last seconds for the black box, all of them for a recording. Memory is allocated at the
// start.
#pragma once

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <haptic/frames.hpp>
#include <haptic/realtime.hpp>
#include "tick/tick_record.hpp"

namespace haptic::rt {

/// The last N ticks, overwritten in a circle. One thread.
class BlackBox {
  public:
    explicit BlackBox(std::size_t capacity);
    void push(const TickRecord& record) HAPTIC_RT;
    [[nodiscard]] std::size_t size() const HAPTIC_RT { return size_; }
    /// Oldest first; index below size().
    [[nodiscard]] const TickRecord& at(std::size_t index) const HAPTIC_RT;

  private:
    std::vector<TickRecord> records_;
    std::size_t next_ = 0;
    std::size_t size_ = 0;
};

/// A queue between two threads, one at each end. Wait-free for both: what finds no room is dropped and counted.
template <class Entry>
class SpscQueue {
  public:
    /// Capacity is rounded up to a power of two, so that indices may wrap.
    explicit SpscQueue(std::size_t capacity) : entries_(std::bit_ceil(std::max<std::size_t>(capacity, 2))) {}

    /// The filling thread: a place for the next entry, which commit() hands over; nullptr if there is no room.
    Entry* claim() HAPTIC_RT {
        const std::uint64_t head = head_.load(std::memory_order_relaxed);  // only this thread writes it
        // acquire: the reader has finished copying out of the places that it gives back.
        if (head - tail_.load(std::memory_order_acquire) == entries_.size()) {
            dropped_.fetch_add(1, std::memory_order_relaxed);
            return nullptr;
        }
        return &entries_[head & (entries_.size() - 1)];
    }
    void commit() HAPTIC_RT {
        // release: the entry before the index that shows it.
        head_.store(head_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
    }

    /// The emptying thread: the oldest entry, which release() gives back; nullptr if there is none.
    const Entry* front() HAPTIC_RT {
        const std::uint64_t tail = tail_.load(std::memory_order_relaxed);  // only this thread writes it
        return tail == head_.load(std::memory_order_acquire) ? nullptr : &entries_[tail & (entries_.size() - 1)];
    }
    void release() HAPTIC_RT { tail_.store(tail_.load(std::memory_order_relaxed) + 1, std::memory_order_release); }

    [[nodiscard]] std::uint64_t dropped() const HAPTIC_RT { return dropped_.load(std::memory_order_relaxed); }

  private:
    // What one thread writes shares no cache line with what the other does.
    alignas(64) std::atomic<std::uint64_t> tail_{0};  // next to be read; the emptying thread's
    alignas(64) std::atomic<std::uint64_t> head_{0};  // next to be written; the filling thread's
    std::atomic<std::uint64_t> dropped_{0};           // the filling thread's
    std::vector<Entry> entries_;
};

/// A contact frame as a tick found it in the ring.
struct RecordedFrame {
    std::int64_t now_ns = 0;                 // of the tick that took it
    FrameDefect defect = FrameDefect::None;  // why it was not rendered
    ContactFrame frame{};                    // proxies from proxy_count on mean nothing
};

/// Ticks and the frames that they took, on their way to a thread that writes them.
class Recorder {
  public:
    explicit Recorder(std::size_t tick_capacity, std::size_t frame_capacity = 64);

    /// The tick's end.
    void push(const TickRecord& record) HAPTIC_RT;
    /// Copies the part in use.
    void push(std::int64_t now_ns, FrameDefect defect, const ContactFrame& frame) HAPTIC_RT;
    /// The writing thread's end: false if there is nothing.
    bool pop(TickRecord& record) HAPTIC_RT;
    [[nodiscard]] SpscQueue<RecordedFrame>& frames() HAPTIC_RT { return frames_; }

    /// Ticks that found no room: drain more often, or make the capacity larger.
    [[nodiscard]] std::uint64_t dropped() const HAPTIC_RT { return ticks_.dropped(); }
    [[nodiscard]] std::uint64_t frames_dropped() const HAPTIC_RT { return frames_.dropped(); }

  private:
    SpscQueue<TickRecord> ticks_;
    SpscQueue<RecordedFrame> frames_;
};

}  // namespace haptic::rt
