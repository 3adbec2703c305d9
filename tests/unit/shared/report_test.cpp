#include "haptic/report.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <stdexcept>

#include "temporary_file.hpp"

namespace haptic {
namespace {

using test::TemporaryDirectory;

TEST(Report, SummarisesInMicroseconds) {
    Histogram histogram;
    for (std::int64_t i = 1; i <= 1000; ++i) {
        histogram.record(i * 1000);
    }
    const nlohmann::json summary = summary_us(histogram);
    EXPECT_EQ(summary.at("min").get<double>(), 1.0);
    EXPECT_EQ(summary.at("max").get<double>(), 1000.0);
    EXPECT_EQ(summary.at("count").get<int>(), 1000);
    // A percentile exceeds the true one by at most one sub-bucket, 1/64.
    EXPECT_NEAR(summary.at("p50").get<double>(), 500.0, 500.0 / 64);
    EXPECT_NEAR(summary.at("p99").get<double>(), 990.0, 990.0 / 64);
    EXPECT_NEAR(summary.at("p999").get<double>(), 999.0, 999.0 / 64);
}

TEST(Report, ListsTheBucketsThatHoldSomething) {
    Histogram histogram;
    histogram.record(10);
    histogram.record(10);
    histogram.record(5'000'000);
    const nlohmann::json buckets = buckets_us(histogram);
    ASSERT_EQ(buckets.size(), 2u);
    EXPECT_DOUBLE_EQ(buckets[0][0].get<double>(), 0.010);
    EXPECT_DOUBLE_EQ(buckets[0][1].get<double>(), 0.011);
    EXPECT_EQ(buckets[0][2].get<int>(), 2);
    EXPECT_LE(buckets[1][0].get<double>(), 5000.0);
    EXPECT_GT(buckets[1][1].get<double>(), 5000.0);
}

TEST(Report, GivesAPeriodInTenthsOfAMicrosecond) {
    PeriodHistogram histogram(1'000'000);
    histogram.record(1'000'010);
    histogram.record(999'990);
    histogram.record(1'000'290);
    EXPECT_DOUBLE_EQ(summary_us(histogram).at("p50").get<double>(), 1000.0);
    const nlohmann::json buckets = buckets_us(histogram);
    ASSERT_EQ(buckets.size(), 2u);
    EXPECT_DOUBLE_EQ(buckets[0][0].get<double>(), 999.95);
    EXPECT_DOUBLE_EQ(buckets[0][1].get<double>(), 1000.05);
    EXPECT_EQ(buckets[0][2].get<int>(), 2);
    EXPECT_DOUBLE_EQ(buckets[1][0].get<double>(), 1000.25);
}

TEST(Report, IsReplacedAsAWhole) {
    const TemporaryDirectory directory;
    const auto file = directory.write("r.json", "old");
    write_report(file, {{"ticks", 5}, {"name", "a\xFF"}});  // not UTF-8: replaced without an exception
    const nlohmann::json read = nlohmann::json::parse(test::content_of(file));
    EXPECT_EQ(read.at("ticks").get<int>(), 5);
    EXPECT_EQ(directory.entries(), 1u);
}

TEST(Report, NamesTheFileThatCannotBeWritten) {
    EXPECT_THAT(test::message_of<std::runtime_error>([] { write_report("/nonexistent/r.json", {}); }),
                testing::StartsWith("/nonexistent/r.json: cannot be written: No such file"));
    EXPECT_THAT(test::message_of<std::runtime_error>([] { write_report("/dev/full", {}); }),
                testing::StartsWith("/dev/full: cannot be written"));
}

TEST(Report, RemovesItsTemporaryFileWhereThePlaceIsTaken) {
    const TemporaryDirectory directory;
    std::filesystem::create_directory(directory.file("r.json"));
    EXPECT_THROW(write_report(directory.file("r.json"), {}), std::runtime_error);
    EXPECT_EQ(directory.entries(), 1u);
}

}  // namespace
}  // namespace haptic
