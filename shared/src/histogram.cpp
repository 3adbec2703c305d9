#include "haptic/histogram.hpp"

#include <algorithm>
#include <cmath>

namespace haptic {

std::uint64_t nearest_rank(double fraction, std::uint64_t count) HAPTIC_RT {
    const double rank = std::ceil(std::clamp(fraction, 0.0, 1.0) * static_cast<double>(count));
    return std::max<std::uint64_t>(1, static_cast<std::uint64_t>(rank));
}

Histogram::Bucket Histogram::bucket(std::size_t index) const HAPTIC_RT {
    const auto lower_ns = static_cast<std::int64_t>(Buckets::lower_of(index));
    return {lower_ns, lower_ns + static_cast<std::int64_t>(Buckets::width_of(index)), counts_[index]};
}

void Histogram::record(std::int64_t duration_ns) HAPTIC_RT {
    duration_ns = std::max<std::int64_t>(0, duration_ns);
    min_ns_ = count_ == 0 ? duration_ns : std::min(min_ns_, duration_ns);
    max_ns_ = std::max(max_ns_, duration_ns);
    sum_ns_ += duration_ns;
    ++count_;
    ++counts_[std::min(Buckets::index_of(static_cast<std::uint64_t>(duration_ns)), kBuckets - 1)];
}

double Histogram::mean_ns() const HAPTIC_RT {
    return count_ == 0 ? 0.0 : static_cast<double>(sum_ns_) / static_cast<double>(count_);
}

std::int64_t Histogram::percentile_ns(double fraction) const HAPTIC_RT {
    if (count_ == 0) {
        return 0;
    }
    const std::uint64_t wanted = nearest_rank(fraction, count_);
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
