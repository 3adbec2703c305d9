#include "haptic/period_histogram.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

namespace haptic {
namespace {

/// Oracle: percentile from the sorted data.
std::int64_t percentile_of(const std::vector<std::int64_t>& sorted, double fraction) {
    const auto rank = static_cast<std::size_t>(std::ceil(fraction * static_cast<double>(sorted.size())));
    return sorted[std::max<std::size_t>(1, rank) - 1];
}

TEST(PeriodHistogram, PercentilesNearThePeriodAreWithinHalfAFineBucketOfTheSortedData) {
    for (const std::int64_t period_ns : {1'000'000, 500'000, 250'000, 125'000}) {
        std::mt19937_64 random(1);
        std::normal_distribution<double> jitter(0.0, 3'000.0);
        PeriodHistogram histogram(period_ns);
        std::vector<std::int64_t> data;
        for (int i = 0; i < 20'000; ++i) {
            data.push_back(period_ns + std::lround(jitter(random)));
            histogram.record(data.back());
        }
        std::sort(data.begin(), data.end());
        for (const double fraction : {0.0, 0.001, 0.1, 0.5, 0.9, 0.99, 0.999, 0.9999, 1.0}) {
            EXPECT_NEAR(static_cast<double>(histogram.percentile_ns(fraction)),
                        static_cast<double>(percentile_of(data, fraction)), PeriodHistogram::kBucketNs / 2.0)
                << period_ns << " ns, " << fraction;
        }
        EXPECT_EQ(histogram.count(), data.size());
        EXPECT_EQ(histogram.min_ns(), data.front());
        EXPECT_EQ(histogram.max_ns(), data.back());
    }
}

TEST(PeriodHistogram, ShowsTheMedianOfALoopThatKeepsItsPeriodAsThatPeriod) {
    PeriodHistogram histogram(1'000'000);
    for (const std::int64_t off_ns : {-5'000, -40, -10, 0, 10, 40, 8'000}) {
        histogram.record(1'000'000 + off_ns);
    }
    EXPECT_EQ(histogram.percentile_ns(0.5), 1'000'000);
}

TEST(PeriodHistogram, KeepsWhatLiesFarFromThePeriodWithinHalfAPerCent) {
    // A loop that missed deadlines: short and long periods on both sides of the fine buckets.
    std::mt19937_64 random(2);
    std::uniform_real_distribution<double> exponent(0.0, 9.9);
    PeriodHistogram histogram(1'000'000);
    std::vector<std::int64_t> data;
    for (int i = 0; i < 20'000; ++i) {
        data.push_back(std::lround(std::pow(10.0, exponent(random))));
        histogram.record(data.back());
    }
    std::sort(data.begin(), data.end());
    for (const double fraction : {0.001, 0.2, 0.5, 0.6, 0.7, 0.9, 0.999}) {
        const auto exact = static_cast<double>(percentile_of(data, fraction));
        EXPECT_NEAR(static_cast<double>(histogram.percentile_ns(fraction)), exact, 1.0 + 0.005 * exact) << fraction;
    }
}

TEST(PeriodHistogram, CountsEachDurationInOneBucketThatHoldsIt) {
    // Ends of the fine buckets, and durations that a bucket of Histogram would hold together with them.
    for (const std::int64_t period_ns :
         {std::int64_t{1'000'000}, std::int64_t{125'000}, std::int64_t{60'000}, std::int64_t{20'000'000'000}}) {
        for (const std::int64_t off_ns : {-100'051, -100'050, -100'049, -51, -50, 49, 50, 100'049, 100'050, 100'051}) {
            const std::int64_t duration_ns = std::max<std::int64_t>(0, period_ns + off_ns);
            PeriodHistogram histogram(period_ns);
            histogram.record(duration_ns);
            std::uint64_t counted = 0;
            for (std::size_t i = 0; i < PeriodHistogram::kBuckets; ++i) {
                const Histogram::Bucket bucket = histogram.bucket(i);
                if (bucket.count > 0) {
                    EXPECT_LE(bucket.lower_ns, duration_ns) << period_ns << " " << off_ns;
                    EXPECT_GT(bucket.upper_ns, duration_ns) << period_ns << " " << off_ns;
                    counted += bucket.count;
                }
            }
            EXPECT_EQ(counted, 1u) << period_ns << " " << off_ns;
        }
    }
}

TEST(PeriodHistogram, ListsItsBucketsInOrder) {
    PeriodHistogram histogram(1'000'000);
    std::mt19937_64 random(3);
    for (int i = 0; i < 5'000; ++i) {
        histogram.record(static_cast<std::int64_t>(random() % 3'000'000));
    }
    std::int64_t last_ns = 0;
    for (std::size_t i = 0; i < PeriodHistogram::kBuckets; ++i) {
        const Histogram::Bucket bucket = histogram.bucket(i);
        if (bucket.count > 0) {
            EXPECT_GE(bucket.lower_ns, last_ns);
            EXPECT_GT(bucket.upper_ns, bucket.lower_ns);
            last_ns = bucket.upper_ns;
        }
    }
}

TEST(PeriodHistogram, OfNothingIsZero) {
    const PeriodHistogram histogram;
    EXPECT_EQ(histogram.percentile_ns(0.5), 0);
    EXPECT_EQ(histogram.min_ns(), 0);
    EXPECT_EQ(histogram.max_ns(), 0);
    EXPECT_EQ(histogram.mean_ns(), 0.0);
}

}  // namespace
}  // namespace haptic
