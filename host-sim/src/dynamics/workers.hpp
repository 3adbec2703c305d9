// Threads that share the loops of a step.
//
// The items of a loop are independent: each writes data of its own. So results have the same bits, whichever thread
// takes which item. The caller takes items one by one from the first on, the others from the last on, so that each
// finds most of its data where it left them; at the end the caller waits only for items that have begun elsewhere.
// Between loops the threads spin, because the next loop of the step follows soon, then sleep until the next step. A
// thread that finds itself on the caller's processor moves to another one: where processors share no cache the kernel
// wakes it there, and leaves it. A thread that loses its processor to another program in mid-item keeps the caller
// waiting for as long as that program runs, a hundred times as long as a loop takes; where that happens, the caller
// does the next loops alone.
#pragma once

#include <sched.h>
#include <time.h>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <thread>
#include <vector>

namespace haptic::sim {

/// Number of processors that this thread may run on, at least 1: those isolated for real time are not among them.
[[nodiscard]] int usable_processors() noexcept;

class Workers {
  public:
    static constexpr int kMaxThreads = 256;
    static constexpr int kMaxChosen = 8;  // without a number given: more wait for one another in most scenes
    static constexpr std::size_t kMaxItems = 1'000'000;

    /// The caller's thread and `threads` - 1 more. Throws std::invalid_argument unless 1 <= threads <= kMaxThreads, and
    /// std::system_error where the system starts none.
    explicit Workers(int threads);
    Workers(const Workers&) = delete;
    Workers& operator=(const Workers&) = delete;
    ~Workers();

    [[nodiscard]] int threads() const noexcept { return static_cast<int>(helper_.size()) + 1; }
    /// How often a thread lost its processor in mid-item, so that the caller did the next loops alone.
    [[nodiscard]] std::uint64_t losses() const noexcept { return losses_; }

    /// Calls item(k) once for each k < count <= kMaxItems, on any thread, and returns when all have returned. One
    /// caller at a time; an item must not call this, must not wait for another one, and must not throw. Denormal
    /// numbers are flushed as they are in the caller.
    template <class Item>
    void for_each(std::size_t count, const Item& item) noexcept {
        const auto call = [](const void* of, std::size_t k) { (*static_cast<const Item*>(of))(k); };
        if (count < 2 || !has_help()) {
            for (std::size_t k = 0; k < count; ++k) {
                item(k);
            }
            return;
        }
        run(count, call, &item);
    }

    /// The same, and calls last() once, as the item after all others: most likely on another thread, if there is one.
    template <class Item, class Last>
    void for_each(std::size_t count, const Item& item, const Last& last) noexcept {
        for_each(count + 1, [&](std::size_t k) {
            if (k == count) {
                last();
            } else {
                item(k);
            }
        });
    }

    /// The same for the indices of `all`, {begin, end}, in ranges of up to `length`: range(begin, end).
    template <class All, class Range>
    void for_ranges(const All& all, std::size_t length, const Range& range) noexcept {
        for_each((all.end - all.begin + length - 1) / length, [&](std::size_t k) {
            const std::size_t begin = all.begin + k * length;
            range(begin, begin + length < all.end ? begin + length : all.end);
        });
    }

  private:
    using Call = void (*)(const void*, std::size_t);

    /// Whether other threads are to take part in the next loop.
    [[nodiscard]] bool has_help() noexcept {
        if (loops_alone_ > 0) {
            --loops_alone_;
            return false;
        }
        return !helper_.empty();
    }
    void run(std::size_t count, Call call, const void* item) noexcept;
    void wait_for_others(std::uint64_t done) noexcept;
    [[nodiscard]] std::chrono::nanoseconds time_of_others() const noexcept;
    void work() noexcept;
    void avoid_caller() noexcept;
    void help() noexcept;

    // The loop, in one line of the cache: a thread that takes an item has the rest of it too. First the number of items
    // and how many were asked for at either end, in one word: nobody takes an item of a loop that has ended.
    alignas(64) std::atomic<std::uint64_t> ticket_{0};
    Call call_ = nullptr;
    const void* item_ = nullptr;
    bool flush_ = false;
    std::atomic<int> caller_processor_{-1};
    // Items that helpers have done, in all loops. Each adds what it did in a loop at once.
    alignas(64) std::atomic<std::uint64_t> done_by_others_{0};
    alignas(64) std::atomic<std::uint32_t> loop_{0};  // counts loops; helpers sleep on it
    std::atomic<int> sleeping_{0};
    std::atomic<bool> end_{false};
    // Loops that the caller does alone: still to come, when they began (by loop_), and how many there were then.
    std::uint32_t loops_alone_ = 0;
    std::uint32_t lost_in_loop_ = 0;
    std::uint32_t loops_alone_at_loss_ = 0;
    std::uint64_t losses_ = 0;
    cpu_set_t allowed_{};           // when constructed
    std::vector<clockid_t> clock_;  // of the processor time of each helper
    std::vector<std::thread> helper_;
};

}  // namespace haptic::sim
