// Period histogram: durations around a nominal period, in fixed memory and constant time.
//
// A loop's periods lie within microseconds of the nominal one, where Histogram's buckets are 4 us wide at 1 ms. Here
// buckets of kBucketNs cover kReachNs on either side of the nominal period, and one bucket is centred on it, so that a
// percentile there is within kBucketNs / 2. What lies outside is kept in one Histogram for each side.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "haptic/histogram.hpp"
#include "haptic/realtime.hpp"

namespace haptic {

class PeriodHistogram {
  public:
    static constexpr std::int64_t kBucketNs = 100;     // ns
    static constexpr std::int64_t kReachNs = 100'000;  // ns, to the centre of the outermost bucket
    static constexpr std::size_t kFineBuckets = 2 * kReachNs / kBucketNs + 1;
    static constexpr std::size_t kBuckets = kFineBuckets + 2 * Histogram::kBuckets;

    /// ns, the period to centre the buckets on; positive.
    explicit PeriodHistogram(std::int64_t nominal_ns = 1'000'000) noexcept : nominal_ns_(nominal_ns) {}

    /// Negative durations count as zero.
    void record(std::int64_t duration_ns) HAPTIC_RT;

    [[nodiscard]] std::int64_t nominal_ns() const HAPTIC_RT { return nominal_ns_; }
    [[nodiscard]] std::uint64_t count() const HAPTIC_RT { return count_; }
    [[nodiscard]] std::int64_t min_ns() const HAPTIC_RT { return count_ == 0 ? 0 : min_ns_; }
    [[nodiscard]] std::int64_t max_ns() const HAPTIC_RT { return max_ns_; }
    [[nodiscard]] double mean_ns() const HAPTIC_RT;
    /// Duration that a fraction (0..1) of all records does not exceed: the middle of its bucket, clamped to minimum and
    /// maximum. 0 if nothing was recorded.
    [[nodiscard]] std::int64_t percentile_ns(double fraction) const HAPTIC_RT;

    /// In the order of their durations, for index < kBuckets. Buckets of the two sides are cut where the fine ones
    /// begin and end; those that would lie beyond are empty, with upper_ns <= lower_ns.
    [[nodiscard]] Histogram::Bucket bucket(std::size_t index) const HAPTIC_RT;

  private:
    /// Lower end (inclusive) and upper end (exclusive) of the fine buckets. They are not whole multiples of kBucketNs:
    /// a bucket is centred on the nominal period.
    [[nodiscard]] std::int64_t fine_begin_ns() const HAPTIC_RT { return nominal_ns_ - kReachNs - kBucketNs / 2; }
    [[nodiscard]] std::int64_t fine_end_ns() const HAPTIC_RT { return nominal_ns_ + kReachNs + kBucketNs / 2; }

    std::int64_t nominal_ns_;
    std::array<std::uint64_t, kFineBuckets> fine_{};
    Histogram below_;
    Histogram above_;
    std::uint64_t count_ = 0;
    std::int64_t min_ns_ = 0;
    std::int64_t max_ns_ = 0;
    std::int64_t sum_ns_ = 0;
};

}  // namespace haptic
