// What a measurement keeps of the ticks besides the histograms of Instruments: the worst of them, with what the kernel
// counted of the thread meanwhile, and the course of the latency over the run.
//
// The loop's thread fills it at the end of each tick, after the motors were sent, at the cost of two system calls. It
// is read when no loop runs; only take_event() may be called meanwhile, by one other thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include <haptic/realtime.hpp>
#include "tick/recorder.hpp"
#include "tick/tick_timing.hpp"

namespace haptic::rt {

/// What a measurement reports a distribution of.
enum class Latency : std::uint8_t { Wakeup, Period, Compute, Exchange, DeviceToPlane, MotionToForce };
inline constexpr std::size_t kLatencies = 6;

/// ns, of one tick; -1 where the tick has none.
[[nodiscard]] std::int64_t latency_of(const TimedTick& tick, Latency latency) HAPTIC_RT;

/// The largest value in each of equally long pieces of a run whose length is not known in advance: when the pieces are
/// used up, two of them become one.
class Course {
  public:
    static constexpr std::size_t kPieces = 512;

    /// Time must not go back.
    void add(std::int64_t at_ns, std::int64_t value_ns) HAPTIC_RT;
    [[nodiscard]] std::int64_t piece_ns() const HAPTIC_RT { return piece_ns_; }
    [[nodiscard]] std::int64_t start_ns() const HAPTIC_RT { return start_ns_; }
    /// ns, up to the piece that was added to last; -1 for one in which nothing happened.
    [[nodiscard]] std::span<const std::int64_t> largest_ns() const HAPTIC_RT { return {largest_ns_.data(), used_}; }

  private:
    void halve() HAPTIC_RT;

    std::array<std::int64_t, kPieces> largest_ns_{};
    std::size_t used_ = 0;
    std::int64_t piece_ns_ = 20'000'000;
    std::int64_t start_ns_ = -1;
};

class TimingLog {
  public:
    static constexpr std::size_t kWorst = 20;

    TimingLog() = default;
    TimingLog(const TimingLog&) = delete;
    TimingLog& operator=(const TimingLog&) = delete;
    ~TimingLog();

    /// The loop's thread, before its first tick: opens what the kernel tells of the calling thread.
    void attach();
    /// The loop's thread: what comes next is measured, and nothing that was before counts.
    void begin() HAPTIC_RT;
    /// The end of a tick by which so many deadlines had passed.
    void add(const TickRecord& record, const TickTiming& timing, std::int64_t missed) HAPTIC_RT;

    /// The ticks that ended latest after their deadlines, the latest first.
    [[nodiscard]] std::span<const TimedTick> worst() const noexcept { return {worst_.data(), worst_count_}; }
    /// The tick that has the largest value; its number is 0 if no tick had any.
    [[nodiscard]] const TimedTick& largest(Latency latency) const noexcept {
        return largest_[static_cast<std::size_t>(latency)];
    }
    /// How often a loop has begun.
    [[nodiscard]] int stretches() const noexcept { return stretches_; }
    /// Ticks by whose end another deadline had passed, and how many had.
    [[nodiscard]] std::uint64_t late_ticks() const noexcept { return late_ticks_; }
    [[nodiscard]] std::uint64_t missed() const noexcept { return missed_; }
    [[nodiscard]] const Course& wakeup() const noexcept { return wakeup_; }
    [[nodiscard]] const Course& compute() const noexcept { return compute_; }

    /// From another thread: the wake-up of a tick that has become one of those kept above; false if there is no more.
    [[nodiscard]] bool take_event(std::int64_t& now_ns) HAPTIC_RT;

  private:
    [[nodiscard]] bool keep(const TimedTick& tick) HAPTIC_RT;
    /// What the kernel has counted of the thread since it began; -1 where it does not tell.
    [[nodiscard]] std::int64_t waited_so_far_ns() const HAPTIC_RT;

    int waits_ = -1;  // file descriptor
    ThreadUsage usage_;
    std::int64_t waited_ns_ = -1;
    std::array<TimedTick, kWorst> worst_{};
    std::size_t worst_count_ = 0;
    std::array<TimedTick, kLatencies> largest_{};
    int stretches_ = 0;
    std::uint64_t late_ticks_ = 0;
    std::uint64_t missed_ = 0;
    Course wakeup_;
    Course compute_;
    SpscQueue<std::int64_t> events_{256};
};

}  // namespace haptic::rt
