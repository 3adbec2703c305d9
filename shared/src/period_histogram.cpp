#include "haptic/period_histogram.hpp"

#include <algorithm>

namespace haptic {

void PeriodHistogram::record(std::int64_t duration_ns) HAPTIC_RT {
    duration_ns = std::max<std::int64_t>(0, duration_ns);
    min_ns_ = count_ == 0 ? duration_ns : std::min(min_ns_, duration_ns);
    max_ns_ = std::max(max_ns_, duration_ns);
    sum_ns_ += duration_ns;
    ++count_;
    if (duration_ns < fine_begin_ns()) {
        below_.record(duration_ns);
    } else if (duration_ns >= fine_end_ns()) {
        above_.record(duration_ns);
    } else {
        ++fine_[static_cast<std::size_t>((duration_ns - fine_begin_ns()) / kBucketNs)];
    }
}

double PeriodHistogram::mean_ns() const HAPTIC_RT {
    return count_ == 0 ? 0.0 : static_cast<double>(sum_ns_) / static_cast<double>(count_);
}

Histogram::Bucket PeriodHistogram::bucket(std::size_t index) const HAPTIC_RT {
    // Below, fine, above.
    if (index < Histogram::kBuckets) {
        Histogram::Bucket one = below_.bucket(index);
        one.upper_ns = std::min(one.upper_ns, fine_begin_ns());
        return one;
    }
    index -= Histogram::kBuckets;
    if (index < kFineBuckets) {
        const std::int64_t lower_ns = fine_begin_ns() + static_cast<std::int64_t>(index) * kBucketNs;
        return {lower_ns, lower_ns + kBucketNs, fine_[index]};
    }
    Histogram::Bucket one = above_.bucket(index - kFineBuckets);
    one.lower_ns = std::max(one.lower_ns, fine_end_ns());
    return one;
}

std::int64_t PeriodHistogram::percentile_ns(double fraction) const HAPTIC_RT {
    if (count_ == 0) {
        return 0;
    }
    // The highest rank is the exact maximum.
    const std::uint64_t wanted = nearest_rank(fraction, count_);
    std::uint64_t seen = 0;
    for (std::size_t i = 0; i < kBuckets && wanted < count_; ++i) {
        const Histogram::Bucket one = bucket(i);
        seen += one.count;
        if (seen >= wanted) {
            // Half of the even width of a fine bucket is its centre.
            return std::clamp((one.lower_ns + one.upper_ns) / 2, min_ns_, max_ns_);
        }
    }
    return max_ns_;
}

}  // namespace haptic
