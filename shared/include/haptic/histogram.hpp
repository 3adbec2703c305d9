// Histogram of durations for the tick: fixed memory, constant-time recording, bounded relative error.
//
// Each power of two is divided into kSubBuckets linear buckets, so that a percentile has a relative error of at most
// 1 / (2 * kSubBuckets) = 0.4 % at any magnitude. Minimum, maximum and sum are exact. Negative durations count as zero;
// the last bucket also counts all longer durations.
// @source Tene 2012, HdrHistogram.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "haptic/realtime.hpp"

namespace haptic {

/// Buckets of values: each below kSubBuckets has its own; from there on each power of two is divided into kSubBuckets
/// of even width.
template <int kBits>
struct LogBuckets {
    static constexpr std::uint64_t kSubBuckets = std::uint64_t{1} << kBits;

    // Magnitude 0: values below kSubBuckets. Magnitude m >= 1 covers [kSubBuckets << (m - 1), kSubBuckets << m) with
    // buckets of width 1 << (m - 1).
    [[nodiscard]] static std::size_t index_of(std::uint64_t value) HAPTIC_RT {
        // The position of the highest bit determines the magnitude.
        const int magnitude = std::max(0, static_cast<int>(std::bit_width(value)) - kBits);
        if (magnitude == 0) {
            return static_cast<std::size_t>(value);
        }
        // The next kBits bits, without the highest one, select the bucket.
        const std::uint64_t sub_bucket = (value >> (magnitude - 1)) - kSubBuckets;
        return static_cast<std::size_t>(static_cast<std::uint64_t>(magnitude) * kSubBuckets + sub_bucket);
    }
    [[nodiscard]] static std::uint64_t width_of(std::size_t index) HAPTIC_RT {
        const std::uint64_t magnitude = index / kSubBuckets;
        return magnitude == 0 ? 1 : std::uint64_t{1} << (magnitude - 1);
    }
    /// The smallest value in a bucket.
    [[nodiscard]] static std::uint64_t lower_of(std::size_t index) HAPTIC_RT {
        const std::uint64_t sub_bucket = index % kSubBuckets;
        return index < kSubBuckets ? sub_bucket : (kSubBuckets + sub_bucket) * width_of(index);
    }
};

/// Rank, at least 1, of the record that a fraction (0..1) of all does not exceed (nearest-rank method).
[[nodiscard]] std::uint64_t nearest_rank(double fraction, std::uint64_t count) HAPTIC_RT;

class Histogram {
  public:
    using Buckets = LogBuckets<7>;
    static constexpr std::uint64_t kSubBuckets = Buckets::kSubBuckets;
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
    std::array<std::uint64_t, kBuckets> counts_{};
    std::uint64_t count_ = 0;
    std::int64_t min_ns_ = 0;
    std::int64_t max_ns_ = 0;
    std::int64_t sum_ns_ = 0;
};

}  // namespace haptic
