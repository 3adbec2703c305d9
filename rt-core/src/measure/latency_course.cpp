#include "measure/latency_course.hpp"

#include <algorithm>
#include <cstdlib>

namespace haptic::rt {

std::int64_t CompactHistogram::middle_ns(std::size_t bucket) noexcept {
    return static_cast<std::int64_t>(((2 * Buckets::lower_of(bucket) + Buckets::width_of(bucket)) << kUnitBits) / 2);
}

void CompactHistogram::record(std::int64_t duration_ns) noexcept {
    const std::uint64_t units = static_cast<std::uint64_t>(std::max<std::int64_t>(0, duration_ns)) >> kUnitBits;
    ++counts_[std::min(Buckets::index_of(units), kBuckets - 1)];
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
    // First bucket whose cumulative count reaches the rank. The last rank is the exact maximum.
    const std::uint64_t rank = nearest_rank(fraction, count_);
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
