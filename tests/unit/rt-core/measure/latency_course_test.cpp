#include "measure/latency_course.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

namespace haptic::rt {
namespace {

constexpr std::int64_t kStepNs = 10'000'000;  // between the values below

/// Nearest-rank percentile of values.
std::int64_t exact_percentile(std::vector<std::int64_t> values, double fraction) {
    std::sort(values.begin(), values.end());
    const auto rank = static_cast<std::size_t>(std::ceil(fraction * static_cast<double>(values.size())));
    return values[std::max<std::size_t>(rank, 1) - 1];
}

/// Half a bucket: 1/32 of the value, and 32 ns of the first buckets.
double half_a_bucket(std::int64_t value_ns) {
    return static_cast<double>(value_ns) / 32.0 + 32.0;
}

TEST(CompactHistogram, HasThePercentilesOfTheSortedValues) {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> magnitude(1.0, 7.4);  // 10 ns to 25 ms
    CompactHistogram histogram;
    std::vector<std::int64_t> values;
    for (int i = 0; i < 20'000; ++i) {
        values.push_back(std::llround(std::pow(10.0, magnitude(random))));
        histogram.record(values.back());
    }
    for (const double fraction : {0.0, 0.1, 0.5, 0.9, 0.99, 0.999}) {
        const std::int64_t exact_ns = exact_percentile(values, fraction);
        EXPECT_NEAR(static_cast<double>(histogram.percentile_ns(fraction)), static_cast<double>(exact_ns),
                    half_a_bucket(exact_ns))
            << fraction;
    }
    EXPECT_EQ(histogram.percentile_ns(1.0), *std::max_element(values.begin(), values.end()));
    EXPECT_EQ(histogram.count(), values.size());
}

TEST(CompactHistogram, HasTheMaximumForWhatIsBeyondItsBuckets) {
    CompactHistogram histogram;
    histogram.record(0);
    for (int i = 0; i < 9; ++i) {
        histogram.record(std::int64_t{3'600'000'000'000});
    }
    EXPECT_EQ(histogram.percentile_ns(0.5), 3'600'000'000'000);
    EXPECT_LE(histogram.percentile_ns(0.1), 64);
    EXPECT_EQ(CompactHistogram{}.percentile_ns(0.5), 0);
}

TEST(CompactHistogram, IsTheHistogramOfAllValuesAfterAnAddition) {
    std::mt19937 random(2);
    std::exponential_distribution<double> duration(1.0 / 30'000.0);
    CompactHistogram all;
    CompactHistogram first;
    CompactHistogram second;
    for (int i = 0; i < 5000; ++i) {
        const std::int64_t value_ns = std::llround(duration(random));
        all.record(value_ns);
        (i % 3 == 0 ? first : second).record(value_ns);
    }
    first.add(second);
    EXPECT_EQ(first.count(), all.count());
    for (const double fraction : {0.01, 0.5, 0.99, 0.999, 1.0}) {
        EXPECT_EQ(first.percentile_ns(fraction), all.percentile_ns(fraction)) << fraction;
    }
}

TEST(LatencyCourse, HasThePercentilesOfEachIntervalOfARunOfAnyLength) {
    std::mt19937 random(3);
    std::uniform_int_distribution<std::int64_t> duration(0, 100'000);
    LatencyCourse course;
    std::vector<std::int64_t> values;
    for (int i = 0; i < 70'000; ++i) {
        // The second half of the run is ten times as late.
        values.push_back(duration(random) * (i < 35'000 ? 1 : 10));
        course.add(5'000'000'000 + i * kStepNs, values.back());
    }
    ASSERT_LE(course.size(), LatencyCourse::kIntervals);
    ASSERT_GT(course.size(), LatencyCourse::kIntervals / 2 - 1);
    EXPECT_EQ(course.start_ns(), 5'000'000'000);
    const std::int64_t steps = course.interval_ns() / kStepNs;
    for (std::size_t i = 0; i < course.size(); ++i) {
        const auto begin = values.begin() + static_cast<std::ptrdiff_t>(i) * steps;
        const auto end = values.end() - begin < steps ? values.end() : begin + steps;
        const std::vector<std::int64_t> own(begin, end);
        ASSERT_EQ(course.at(i).count(), own.size()) << i;
        ASSERT_EQ(course.at(i).max_ns(), *std::max_element(begin, end)) << i;
        const std::int64_t median_ns = exact_percentile(own, 0.5);
        ASSERT_NEAR(static_cast<double>(course.at(i).percentile_ns(0.5)), static_cast<double>(median_ns),
                    half_a_bucket(median_ns))
            << i;
    }
}

TEST(LatencyCourse, LeavesIntervalsEmptyWhereNothingRan) {
    LatencyCourse course;
    course.add(0, 7);
    course.add(3 * course.interval_ns(), 9);
    ASSERT_EQ(course.size(), 4U);
    EXPECT_EQ(course.at(0).max_ns(), 7);
    EXPECT_EQ(course.at(1).count(), 0U);
    EXPECT_EQ(course.at(2).count(), 0U);
    EXPECT_EQ(course.at(3).max_ns(), 9);
}

TEST(LatencyCourse, SumsThePartsOfARun) {
    LatencyCourse course;
    for (int i = 0; i < 10; ++i) {
        course.add(i * course.interval_ns(), 1000 * (i + 1));
    }
    const CompactHistogram first = course.between(0, 3 * course.interval_ns());
    EXPECT_EQ(first.count(), 3U);
    EXPECT_EQ(first.max_ns(), 3000);
    const CompactHistogram last = course.between(8 * course.interval_ns(), 10 * course.interval_ns());
    EXPECT_EQ(last.count(), 2U);
    EXPECT_EQ(last.max_ns(), 10'000);
}

TEST(RunCourse, TakesEachTickFromTheLog) {
    constexpr std::int64_t period_ns = 1'000'000;
    const auto log = std::make_unique<TimingLog>();
    RunCourse course(period_ns);
    // Periods 30 us too long and too short in turn; the first tick has none.
    for (std::uint64_t i = 1; i <= 101; ++i) {
        TickRecord record;
        record.number = i;
        record.deadline_ns = static_cast<std::int64_t>(i) * period_ns;
        record.now_ns = record.deadline_ns + (i % 2 == 0 ? 40'000 : 10'000);
        record.period_ns = i == 1 ? 0 : period_ns + (i % 2 == 0 ? 30'000 : -30'000);
        record.compute_ns = 5000;
        log->add(record, {}, 0);
    }
    course.take(*log);
    const std::int64_t whole_ns = course.wakeup.interval_ns() * static_cast<std::int64_t>(LatencyCourse::kIntervals);
    EXPECT_EQ(course.wakeup.between(0, whole_ns).count(), 101U);
    EXPECT_EQ(course.wakeup.between(0, whole_ns).max_ns(), 40'000);
    EXPECT_EQ(course.compute.between(0, whole_ns).percentile_ns(1.0), 5000);
    EXPECT_EQ(course.jitter.between(0, whole_ns).count(), 100U);
    EXPECT_NEAR(static_cast<double>(course.jitter.between(0, whole_ns).percentile_ns(0.01)), 30'000.0,
                half_a_bucket(30'000));
    EXPECT_EQ(course.lost, 0U);
}

TEST(RunCourse, CountsTheTicksThatNobodyTook) {
    const auto log = std::make_unique<TimingLog>();
    RunCourse course(1'000'000);
    TickRecord record;
    for (std::uint64_t i = 1; i <= TimingLog::kQueued + 5; ++i) {
        record.number = i;
        record.now_ns = static_cast<std::int64_t>(i);
        log->add(record, {}, 0);
    }
    course.take(*log);
    EXPECT_EQ(course.lost, 5U);
    EXPECT_EQ(course.wakeup.at(0).count(), TimingLog::kQueued);
}

}  // namespace
}  // namespace haptic::rt
