// Where ticks are kept: the last seconds for the black box, all of them for a recording. Memory is allocated at the
// start.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "haptic/realtime.hpp"
#include "haptic/rt/tick_record.hpp"

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

/// A queue from the tick to a thread that writes. Wait-free for the tick: what finds no room is dropped and counted.
class Recorder {
  public:
    explicit Recorder(std::size_t capacity);

    /// The tick's end.
    void push(const TickRecord& record) HAPTIC_RT;
    /// The writing thread's end: false if there is nothing.
    bool pop(TickRecord& record) HAPTIC_RT;

    /// Records that found no room: drain more often, or make the capacity larger.
    [[nodiscard]] std::uint64_t dropped() const HAPTIC_RT { return dropped_.load(std::memory_order_relaxed); }

  private:
    // What one thread writes shares no cache line with what the other does.
    alignas(64) std::atomic<std::uint64_t> tail_{0};  // next to be read; the writing thread's
    alignas(64) std::atomic<std::uint64_t> head_{0};  // next to be written; the tick's
    std::atomic<std::uint64_t> dropped_{0};           // the tick's
    std::vector<TickRecord> records_;                 // a power of two, so that indices may wrap
};

}  // namespace haptic::rt
