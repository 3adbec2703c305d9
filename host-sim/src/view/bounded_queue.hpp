// A queue of fixed length between two threads, one that pushes and one that pops. Neither waits: what finds no room
// is left to the caller.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <utility>

namespace haptic::sim::view {

/// Capacity is a power of two.
template <class Value, std::size_t kCapacity>
class BoundedQueue {
    static_assert(kCapacity > 0 && (kCapacity & (kCapacity - 1)) == 0);

  public:
    /// False, and `value` as it was, if there is no room.
    [[nodiscard]] bool push(Value&& value) noexcept {
        const std::size_t tail = tail_.load(std::memory_order_relaxed);  // this thread's own
        // Acquire: the other thread has moved the value out before its place is written anew.
        if (tail - head_.load(std::memory_order_acquire) == kCapacity) {
            return false;
        }
        values_[tail % kCapacity] = std::move(value);
        tail_.store(tail + 1, std::memory_order_release);  // the value before its place counts
        return true;
    }

    /// False, and `value` as it was, if there is nothing.
    [[nodiscard]] bool pop(Value& value) noexcept {
        const std::size_t head = head_.load(std::memory_order_relaxed);  // this thread's own
        // Acquire: what was written before the place counted is seen.
        if (head == tail_.load(std::memory_order_acquire)) {
            return false;
        }
        value = std::move(values_[head % kCapacity]);
        head_.store(head + 1, std::memory_order_release);  // moved out before the place is free
        return true;
    }

  private:
    std::array<Value, kCapacity> values_{};
    // Apart, so that the two threads do not take one cache line from each other.
    alignas(64) std::atomic<std::size_t> head_{0};  // taken so far
    alignas(64) std::atomic<std::size_t> tail_{0};  // pushed so far
};

}  // namespace haptic::sim::view
