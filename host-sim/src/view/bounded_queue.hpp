// Bounded single-producer, single-consumer queue: lock-free, and it never blocks. A full or empty queue is reported to
// the caller.
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
    /// Returns false and leaves `value` unchanged when the queue is full.
    [[nodiscard]] bool push(Value&& value) noexcept {
        const std::size_t tail = tail_.load(std::memory_order_relaxed);  // written by this thread only
        // Acquire: the consumer has moved the value out before its slot is overwritten.
        if (tail - head_.load(std::memory_order_acquire) == kCapacity) {
            return false;
        }
        values_[tail % kCapacity] = std::move(value);
        tail_.store(tail + 1, std::memory_order_release);  // release: the value is visible before its slot counts
        return true;
    }

    /// Returns false and leaves `value` unchanged when the queue is empty.
    [[nodiscard]] bool pop(Value& value) noexcept {
        const std::size_t head = head_.load(std::memory_order_relaxed);  // written by this thread only
        // Acquire: the value is visible once its slot counts.
        if (head == tail_.load(std::memory_order_acquire)) {
            return false;
        }
        value = std::move(values_[head % kCapacity]);
        head_.store(head + 1, std::memory_order_release);  // release: the value has left before its slot is free
        return true;
    }

  private:
    std::array<Value, kCapacity> values_{};
    // On separate cache lines, to avoid false sharing between the two threads.
    alignas(64) std::atomic<std::size_t> head_{0};  // popped so far
    alignas(64) std::atomic<std::size_t> tail_{0};  // pushed so far
};

}  // namespace haptic::sim::view
