// Triple buffer: hands the newest value from one thread to another without a lock and without a copy.
//
// The writer owns one buffer, the reader another, and the third lies between them. To publish, the writer exchanges its
// buffer for the middle one; to take, the reader does the same. Neither ever waits, and a value that the reader did not
// take in time is overwritten.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

namespace haptic::sim::view {

template <class Value>
class TripleBuffer {
  public:
    /// Calls prepare(value) on all three, before the threads share them.
    template <class Prepare>
    void prepare(Prepare&& prepare) {
        for (Value& buffer : buffers_) {
            prepare(buffer);
        }
    }

    /// Writer: the buffer to fill; its content is that of some earlier value.
    [[nodiscard]] Value& back() noexcept { return buffers_[back_]; }

    /// Writer: makes back() the newest value; back() is another buffer afterwards.
    void publish() noexcept {
        // Release: the reader that takes this buffer sees what was written to it. Acquire: the reader has finished with
        // the buffer that comes back.
        back_ = between_.exchange(static_cast<std::uint8_t>(back_ | kFresh), std::memory_order_acq_rel) & kIndex;
    }

    /// Reader: makes front() the newest value; returns false if nothing was published since the last call.
    bool take() noexcept {
        // Relaxed: a stale answer only means that the value is taken at the next call.
        if ((between_.load(std::memory_order_relaxed) & kFresh) == 0) {
            return false;
        }
        // As in publish(), with the roles exchanged. Only this function clears kFresh, so it is still set.
        front_ = between_.exchange(front_, std::memory_order_acq_rel) & kIndex;
        return true;
    }

    /// Reader: the value taken last, or the initial value.
    [[nodiscard]] const Value& front() const noexcept { return buffers_[front_]; }

  private:
    static constexpr std::uint8_t kIndex = 3;
    static constexpr std::uint8_t kFresh = 4;  // published and not yet taken

    std::array<Value, 3> buffers_{};
    std::uint8_t back_ = 0;   // owned by the writer
    std::uint8_t front_ = 1;  // owned by the reader
    std::atomic<std::uint8_t> between_{2};
    static_assert(std::atomic<std::uint8_t>::is_always_lock_free);
};

}  // namespace haptic::sim::view
