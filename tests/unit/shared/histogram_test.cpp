#include "haptic/histogram.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace haptic {
namespace {

/// Oracle: percentile from the sorted data.
std::int64_t exact_percentile(const std::vector<std::int64_t>& sorted, double fraction) {
    const auto rank = static_cast<std::size_t>(std::ceil(fraction * static_cast<double>(sorted.size())));
    return sorted[std::max<std::size_t>(1, rank) - 1];
}

TEST(Histogram, PercentilesAreWithinHalfASubBucketOfTheSortedData) {
    std::mt19937_64 random(1);
    std::lognormal_distribution<double> durations(8.0, 3.0);
    Histogram histogram;
    std::vector<std::int64_t> data;
    for (int i = 0; i < 20'000; ++i) {
        data.push_back(static_cast<std::int64_t>(durations(random)));
        histogram.record(data.back());
    }
    std::sort(data.begin(), data.end());
    for (const double fraction : {0.0, 0.001, 0.1, 0.25, 0.5, 0.9, 0.99, 0.999, 0.9999, 1.0}) {
        const std::int64_t exact = exact_percentile(data, fraction);
        const std::int64_t shown = histogram.percentile_ns(fraction);
        EXPECT_NEAR(static_cast<double>(shown), static_cast<double>(exact),
                    static_cast<double>(exact) / (2.0 * Histogram::kSubBuckets))
            << fraction;
    }
    EXPECT_EQ(histogram.count(), data.size());
    EXPECT_EQ(histogram.min_ns(), data.front());
    EXPECT_EQ(histogram.max_ns(), data.back());
    double sum = 0.0;
    for (const std::int64_t value : data) {
        sum += static_cast<double>(value);
    }
    EXPECT_NEAR(histogram.mean_ns(), sum / static_cast<double>(data.size()), 1e-6 * histogram.mean_ns());
}

TEST(Histogram, ASteadyPeriodIsShownAsItIs) {
    Histogram histogram;
    for (int i = 0; i < 1000; ++i) {
        histogram.record(1'000'000);
    }
    EXPECT_EQ(histogram.percentile_ns(0.5), 1'000'000);
    EXPECT_EQ(histogram.percentile_ns(0.999), 1'000'000);
}

TEST(Histogram, BucketsTileTheAxisWithoutGapOrOverlap) {
    const Histogram histogram;
    EXPECT_EQ(histogram.bucket(0).lower_ns, 0);
    for (std::size_t i = 1; i < Histogram::kBuckets; ++i) {
        ASSERT_EQ(histogram.bucket(i).lower_ns, histogram.bucket(i - 1).upper_ns) << i;
    }
    EXPECT_EQ(histogram.bucket(Histogram::kBuckets - 1).upper_ns, std::int64_t{1} << 36);
}

TEST(Histogram, EachDurationFallsIntoTheBucketThatHoldsIt) {
    std::mt19937_64 random(2);
    for (int i = 0; i < 500; ++i) {
        const auto duration = static_cast<std::int64_t>(random() >> (28 + random() % 36));
        Histogram histogram;
        histogram.record(duration);
        for (std::size_t k = 0; k < Histogram::kBuckets; ++k) {
            const Histogram::Bucket bucket = histogram.bucket(k);
            const bool inside = bucket.lower_ns <= duration && duration < bucket.upper_ns;
            ASSERT_EQ(bucket.count, inside ? 1u : 0u) << duration << " bucket " << k;
        }
    }
}

TEST(Histogram, TakesNegativeDurationsAsZeroAndOverlongOnesIntoTheLastBucket) {
    Histogram histogram;
    histogram.record(-5);
    EXPECT_EQ(histogram.min_ns(), 0);
    EXPECT_EQ(histogram.percentile_ns(1.0), 0);
    const std::int64_t hour = 3'600'000'000'000;
    histogram.record(hour);
    EXPECT_EQ(histogram.bucket(Histogram::kBuckets - 1).count, 1u);
    EXPECT_EQ(histogram.max_ns(), hour);
    EXPECT_EQ(histogram.percentile_ns(1.0), hour);
}

TEST(Histogram, SaysZeroOfNothing) {
    Histogram histogram;
    histogram.record(7);
    histogram.clear();
    EXPECT_EQ(histogram.count(), 0u);
    EXPECT_EQ(histogram.min_ns(), 0);
    EXPECT_EQ(histogram.max_ns(), 0);
    EXPECT_EQ(histogram.percentile_ns(0.5), 0);
    EXPECT_EQ(histogram.mean_ns(), 0.0);
}

}  // namespace
}  // namespace haptic
