#include "measure/latency_course.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>

namespace haptic::rt {

std::size_t CompactHistogram::bucket_of(std::int64_t duration_ns) noexcept {
    // The position of the highest bit is the magnitude, the next kSubBucketBits bits select the bucket in it.
    const std::uint64_t units = static_cast<std::uint64_t>(std::max<std::int64_t>(0, duration_ns)) >> kUnitBits;
    const int magnitude = std::max(0, static_cast<int>(std::bit_width(units)) - kSubBucketBits);
    if (magnitude == 0) {
        return static_cast<std::size_t>(units);
    }
    const std::uint64_t sub_bucket = (units >> (magnitude - 1)) - kSubBuckets;
    return std::min(static_cast<std::size_t>(magnitude) * kSubBuckets + static_cast<std::size_t>(sub_bucket),
                    kBuckets - 1);
}

std::int64_t CompactHistogram::middle_ns(std::size_t bucket) noexcept {
    const std::size_t magnitude = bucket / kSubBuckets;
    const std::size_t sub_bucket = bucket % kSubBuckets;
    // Inverse of bucket_of(): lower end and width of the bucket, in units.
    const std::size_t width = magnitude == 0 ? 1 : std::size_t{1} << (magnitude - 1);
    const std::size_t lower = magnitude == 0 ? sub_bucket : (kSubBuckets + sub_bucket) * width;
    return static_cast<std::int64_t>(((2 * lower + width) << kUnitBits) / 2);
}

void CompactHistogram::record(std::int64_t duration_ns) noexcept {
    ++counts_[bucket_of(duration_ns)];
    ++count_;
    max_ns_ = std::max(max_ns_, duration_ns);
}

void CompactHistogram::add(const CompactHistogram& other) noexcept {
    for (std::size_t i = 0; i < kBuckets; ++i) {
        counts_[i] += other.counts_[i];
    }
    count_ += other.count_;
    max_ns_ = std::max(max_ns_, other.max_ns_);
}

std::int64_t CompactHistogram::percentile_ns(double fraction) const noexcept {
    // First bucket whose cumulative count reaches the rank (nearest-rank method). The last rank is the exact maximum.
    const auto rank = static_cast<std::uint64_t>(
        std::max(1.0, std::ceil(std::clamp(fraction, 0.0, 1.0) * static_cast<double>(count_))));
    std::uint64_t seen = 0;
    for (std::size_t i = 0; i + 1 < kBuckets && rank < count_; ++i) {
        seen += counts_[i];
        if (seen >= rank) {
            return std::min(middle_ns(i), max_ns_);
        }
    }
    return max_ns_;
}

void LatencyCourse::add(std::int64_t at_ns, std::int64_t duration_ns) {
    if (start_ns_ < 0) {
        start_ns_ = at_ns;
    }
    const std::int64_t since_ns = std::max<std::int64_t>(0, at_ns - start_ns_);
    while (since_ns / interval_ns_ >= static_cast<std::int64_t>(kIntervals)) {
        merge_pairs();
    }
    const auto interval = static_cast<std::size_t>(since_ns / interval_ns_);
    used_ = std::max(used_, interval + 1);
    intervals_[interval].record(duration_ns);
}

void LatencyCourse::merge_pairs() noexcept {
    for (std::size_t i = 0; i < kIntervals / 2; ++i) {
        CompactHistogram pair = intervals_[2 * i];
        pair.add(intervals_[2 * i + 1]);
        intervals_[i] = pair;
    }
    std::fill(intervals_.begin() + kIntervals / 2, intervals_.end(), CompactHistogram{});
    used_ = (used_ + 1) / 2;
    interval_ns_ *= 2;
}

CompactHistogram LatencyCourse::between(std::int64_t from_ns, std::int64_t to_ns) const noexcept {
    CompactHistogram sum;
    for (std::size_t i = 0; i < used_; ++i) {
        const std::int64_t begin_ns = static_cast<std::int64_t>(i) * interval_ns_;
        if (begin_ns >= from_ns && begin_ns < to_ns) {
            sum.add(intervals_[i]);
        }
    }
    return sum;
}

void RunCourse::take(TimingLog& log) {
    TickLatencies tick;
    while (log.take_latencies(tick)) {
        wakeup.add(tick.now_ns, tick.wakeup_ns);
        compute.add(tick.now_ns, tick.compute_ns);
        if (tick.period_ns > 0) {
            jitter.add(tick.now_ns, std::abs(tick.period_ns - period_ns));
        }
    }
    lost = log.lost_latencies();
}

}  // namespace haptic::rt
