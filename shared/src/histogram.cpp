#include "haptic/histogram.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace haptic {

// Magnitude 0: each duration below kSubBuckets has its own bucket. Magnitude m >= 1 covers
// [kSubBuckets << (m - 1), kSubBuckets << m) with kSubBuckets buckets of width 1 << (m - 1).
std::size_t Histogram::index_of(std::uint64_t duration_ns) HAPTIC_RT {
    // The position of the highest bit determines the magnitude.
    const int magnitude = std::max(0, static_cast<int>(std::bit_width(duration_ns)) - kSubBucketBits);
    if (magnitude > kMagnitudes) {
        return kBuckets - 1;
    }
    if (magnitude == 0) {
        return static_cast<std::size_t>(duration_ns);
    }
    // The next kSubBucketBits bits, without the highest one, select the bucket.
    const std::uint64_t sub_bucket = (duration_ns >> (magnitude - 1)) - kSubBuckets;
    return static_cast<std::size_t>(static_cast<std::uint64_t>(magnitude) * kSubBuckets + sub_bucket);
}

Histogram::Bucket Histogram::bucket(std::size_t index) const HAPTIC_RT {
    const std::uint64_t magnitude = index / kSubBuckets;
    const std::uint64_t sub_bucket = index % kSubBuckets;
    if (magnitude == 0) {
        return {static_cast<std::int64_t>(sub_bucket), static_cast<std::int64_t>(sub_bucket + 1), counts_[index]};
    }
    // Inverse of index_of().
    const std::uint64_t width = std::uint64_t{1} << (magnitude - 1);
    const std::uint64_t lower = (kSubBuckets + sub_bucket) * width;
    return {static_cast<std::int64_t>(lower), static_cast<std::int64_t>(lower + width), counts_[index]};
}

void Histogram::record(std::int64_t duration_ns) HAPTIC_RT {
    duration_ns = std::max<std::int64_t>(0, duration_ns);
    min_ns_ = count_ == 0 ? duration_ns : std::min(min_ns_, duration_ns);
    max_ns_ = std::max(max_ns_, duration_ns);
    sum_ns_ += duration_ns;
    ++count_;
    ++counts_[index_of(static_cast<std::uint64_t>(duration_ns))];
}

double Histogram::mean_ns() const HAPTIC_RT {
    return count_ == 0 ? 0.0 : static_cast<double>(sum_ns_) / static_cast<double>(count_);
}

std::int64_t Histogram::percentile_ns(double fraction) const HAPTIC_RT {
    if (count_ == 0) {
        return 0;
    }
    // Rank of the percentile (nearest-rank method), at least 1.
    const double rank = std::ceil(std::clamp(fraction, 0.0, 1.0) * static_cast<double>(count_));
    const std::uint64_t wanted = std::max<std::uint64_t>(1, static_cast<std::uint64_t>(rank));
    // First bucket whose cumulative count reaches the rank. The highest rank is the exact maximum.
    std::uint64_t seen = 0;
    for (std::size_t i = 0; i + 1 < kBuckets && wanted < count_; ++i) {
        seen += counts_[i];
        if (seen >= wanted) {
            const Bucket found = bucket(i);
            return std::clamp((found.lower_ns + found.upper_ns - 1) / 2, min_ns_, max_ns_);
        }
    }
    return max_ns_;
}

}  // namespace haptic
