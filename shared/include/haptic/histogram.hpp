// Histogram of durations for the tick: fixed memory, constant-time recording, bounded relative error.
//
// Each power of two is divided into kSubBuckets linear buckets, so that a percentile has a relative error of at most
// 1 / (2 * kSubBuckets) = 0.4 % at any magnitude. Minimum, maximum and sum are exact. Negative durations count as zero;
// the last bucket also counts all longer durations.
// @source Tene 2012, HdrHistogram.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "haptic/realtime.hpp"

namespace haptic {

class Histogram {
  public:
    static constexpr int kSubBucketBits = 7;
    static constexpr std::uint64_t kSubBuckets = 1u << kSubBucketBits;
    static constexpr int kMagnitudes = 29;  // up to 2^36 ns, about 69 s
    static constexpr std::size_t kBuckets = (kMagnitudes + 1) * kSubBuckets;

    void record(std::int64_t duration_ns) HAPTIC_RT;
    void clear() HAPTIC_RT { *this = Histogram{}; }

    [[nodiscard]] std::uint64_t count() const HAPTIC_RT { return count_; }
    [[nodiscard]] std::int64_t min_ns() const HAPTIC_RT { return count_ == 0 ? 0 : min_ns_; }
    [[nodiscard]] std::int64_t max_ns() const HAPTIC_RT { return max_ns_; }
    [[nodiscard]] double mean_ns() const HAPTIC_RT;
    /// Duration that a fraction (0..1) of all records does not exceed: the middle of its bucket, clamped to minimum and
    /// maximum. 0 if nothing was recorded.
    [[nodiscard]] std::int64_t percentile_ns(double fraction) const HAPTIC_RT;

    struct Bucket {
        std::int64_t lower_ns;  // inclusive
        std::int64_t upper_ns;  // exclusive
        std::uint64_t count;
    };
    [[nodiscard]] Bucket bucket(std::size_t index) const HAPTIC_RT;

  private:
    [[nodiscard]] static std::size_t index_of(std::uint64_t duration_ns) HAPTIC_RT;

    std::array<std::uint64_t, kBuckets> counts_{};
    std::uint64_t count_ = 0;
    std::int64_t min_ns_ = 0;
    std::int64_t max_ns_ = 0;
    std::int64_t sum_ns_ = 0;
};

}  // namespace haptic
