// Hands the newest of many values from one thread to another, without a lock and without a copy.
//
// Three buffers: one belongs to the writer, one to the reader, and one lies between them. To publish, the writer
// exchanges its own for the one between; to take, the reader does the same. Neither ever waits, and what the reader
// did not take in time is overwritten.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

namespace haptic::sim::view {

template <class Value>
class Newest {
  public:
    /// Calls prepare(value) on all three, before the two threads share them.
    template <class Prepare>
    void prepare(Prepare&& prepare) {
        for (Value& buffer : buffers_) {
            prepare(buffer);
        }
    }

    /// Writer: to be filled; holds whatever was published some time before.
    [[nodiscard]] Value& back() noexcept { return buffers_[back_]; }

    /// Writer: what back() refers to is the newest from here on, and back() is another.
    void publish() noexcept {
        // Release: the reader that takes this buffer sees what was written to it. Acquire: what the reader read of
        // the buffer that comes back was read before it is written anew.
        back_ = between_.exchange(static_cast<std::uint8_t>(back_ | kFresh), std::memory_order_acq_rel) & kIndex;
    }

    /// Reader: true if something was published since the last time; front() is the newest then.
    bool take() noexcept {
        // Relaxed: a stale answer only means that the newest is taken the next time.
        if ((between_.load(std::memory_order_relaxed) & kFresh) == 0) {
            return false;
        }
        // As in publish(), with the roles exchanged. Only the writer sets kFresh, so it is still set.
        front_ = between_.exchange(front_, std::memory_order_acq_rel) & kIndex;
        return true;
    }

    /// Reader: what was taken last; the initial value before that.
    [[nodiscard]] const Value& front() const noexcept { return buffers_[front_]; }

  private:
    static constexpr std::uint8_t kIndex = 3;
    static constexpr std::uint8_t kFresh = 4;  // published, and not taken

    std::array<Value, 3> buffers_{};
    std::uint8_t back_ = 0;   // the writer's
    std::uint8_t front_ = 1;  // the reader's
    std::atomic<std::uint8_t> between_{2};
    static_assert(std::atomic<std::uint8_t>::is_always_lock_free);
};

}  // namespace haptic::sim::view
