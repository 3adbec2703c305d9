// Course of a measurement: percentiles of a latency in each interval of a run of unknown length, in constant memory.
//
// Each interval has a logarithmic histogram. When the intervals are used up, pairs of them are merged and their length
// is doubled, so that a day takes as much memory as a second. The tick only queues its latencies (TimingLog); this is
// filled from them by the thread that supervises the loop.
// @source Tene 2012, HdrHistogram: the buckets, here with 16 of them in each power of two.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "haptic/histogram.hpp"
#include "process/timing_log.hpp"

namespace haptic::rt {

/// Distribution of durations in about 1 kB: a percentile has a relative error of at most 1/32 and 32 ns, beyond 33 ms
/// it is the maximum. The maximum is exact. At most 2^32 - 1 durations a bucket.
class CompactHistogram {
  public:
    void record(std::int64_t duration_ns) noexcept;
    /// Adds all durations of another one.
    void add(const CompactHistogram& other) noexcept;

    [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
    /// 0 if nothing was recorded.
    [[nodiscard]] std::int64_t max_ns() const noexcept { return max_ns_; }
    /// Duration that a fraction (0..1) does not exceed: the middle of its bucket, at most the maximum.
    [[nodiscard]] std::int64_t percentile_ns(double fraction) const noexcept;

  private:
    using Buckets = LogBuckets<4>;  // of units of 64 ns
    static constexpr int kUnitBits = 6;
    static constexpr std::size_t kBuckets = 16 * Buckets::kSubBuckets;

    /// Middle of a bucket, ns.
    [[nodiscard]] static std::int64_t middle_ns(std::size_t bucket) noexcept;

    std::array<std::uint32_t, kBuckets> counts_{};
    std::uint64_t count_ = 0;
    std::int64_t max_ns_ = 0;
};

/// The course of one latency: half a megabyte, allocated by the constructor.
class LatencyCourse {
  public:
    static constexpr std::size_t kIntervals = 512;

    LatencyCourse() : intervals_(kIntervals) {}

    /// Adds a duration; at_ns must not lie before the first one's. O(1) amortised.
    void add(std::int64_t at_ns, std::int64_t duration_ns);

    /// Time of the first duration; -1 if there is none.
    [[nodiscard]] std::int64_t start_ns() const noexcept { return start_ns_; }
    [[nodiscard]] std::int64_t interval_ns() const noexcept { return interval_ns_; }
    /// Number of intervals up to the last used one; those in between may be empty.
    [[nodiscard]] std::size_t size() const noexcept { return used_; }
    [[nodiscard]] const CompactHistogram& at(std::size_t interval) const noexcept { return intervals_[interval]; }
    /// The durations of the intervals that begin in [from, to), relative to the start, ns.
    [[nodiscard]] CompactHistogram between(std::int64_t from_ns, std::int64_t to_ns) const noexcept;

  private:
    void merge_pairs() noexcept;

    std::vector<CompactHistogram> intervals_;
    std::size_t used_ = 0;
    std::int64_t interval_ns_ = 20'000'000;
    std::int64_t start_ns_ = -1;
};

/// Courses of a measurement.
struct RunCourse {
    explicit RunCourse(std::int64_t nominal_period_ns) : period_ns(nominal_period_ns) {}

    /// Takes the latencies that the log has queued. Call several times a second while the loop runs.
    void take(TimingLog& log);

    std::int64_t period_ns;
    LatencyCourse wakeup;
    LatencyCourse jitter;  // |period - period_ns|; the first tick after a pause has none
    LatencyCourse compute;
    std::uint64_t lost = 0;  // ticks that found the log's queue full
};

}  // namespace haptic::rt
