#include "measure/measure_page.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "measure/measure_report.hpp"
#include "plot_checks.hpp"

namespace haptic::rt {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

constexpr const char* kRedraw = "Draw it with this command.";

std::size_t times(const std::string& text, const std::string& part) {
    std::size_t count = 0;
    for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) {
        ++count;
    }
    return count;
}

/// A report of this many ticks; 0 leaves all distributions empty.
nlohmann::json report_of(int ticks, const std::string& device = "a device",
                         const std::vector<std::int64_t>& periods_ns = {}, std::vector<MeasuredPeer> peers = {}) {
    const auto instruments = std::make_unique<Instruments>();
    const auto log = std::make_unique<TimingLog>();
    RunResult result;
    result.device = device;
    for (int i = 1; i <= ticks; ++i) {
        TickRecord record;
        record.number = instruments->ticks = static_cast<std::uint64_t>(i);
        const std::int64_t late_ns = std::int64_t{1000} * i;
        record.deadline_ns = 1000 * late_ns;
        record.now_ns = record.deadline_ns + late_ns;
        record.compute_ns = 5000;
        instruments->wakeup.record(late_ns);
        instruments->compute.record(5000);
        log->add(record, {}, 0);
    }
    for (const std::int64_t period_ns : periods_ns) {
        instruments->period.record(period_ns);
    }
    const KernelWatch kernel(0, "/nowhere");
    const auto course = std::make_unique<RunCourse>(1'000'000);
    course->take(*log);
    return make_measure_report({.result = &result,
                                .instruments = instruments.get(),
                                .log = log.get(),
                                .kernel = &kernel,
                                .course = course.get(),
                                .peers = std::move(peers)});
}

TEST(MeasurePage, DrawsEachDistributionWithValues) {
    const std::string page = measure_page(report_of(100), kRedraw);
    EXPECT_EQ(times(page, "<figure class=\"gnuplot\">"), 5U) << "tails, two courses, wake-up and compute";
    EXPECT_THAT(page, Not(HasSubstr("<script")));
    if (!has_gnuplot()) {
        GTEST_SKIP() << "there is no gnuplot: package gnuplot-nox";
    }
    EXPECT_EQ(times(page, "<svg "), 5U);
    EXPECT_EQ(times(page, "<svg "), times(page, "</svg>"));
    EXPECT_THAT(page, Not(HasSubstr(kRedraw)));
}

TEST(MeasurePage, DrawsThePercentilesOverTheRun) {
    if (!has_gnuplot()) {
        GTEST_SKIP() << "there is no gnuplot: package gnuplot-nox";
    }
    const nlohmann::json report = report_of(100);
    std::map<std::string, int> names;
    for (const PlotLabel& label : plot_labels(measure_page(report, kRedraw))) {
        ++names[label.text];
    }
    for (const char* name : {"p50", "p99", "p99.9", "maximum"}) {
        EXPECT_GE(names[name], 2) << name << ", of wake-up and compute";
    }
    // Reports of versions before have the maxima alone.
    nlohmann::json older = report;
    for (const char* latency : {"wakeup", "compute"}) {
        for (const char* key : {"p50_us", "p99_us", "p999_us", "ticks"}) {
            older["measure"]["course"][latency].erase(key);
        }
    }
    for (const char* key : {"first", "last", "jitter", "lost_ticks"}) {
        older["measure"]["course"].erase(key);
    }
    older["measure"].erase("timerlat");
    older["measure"].erase("osnoise");
    EXPECT_EQ(times(measure_page(older, kRedraw), "<svg "), 5U);
    EXPECT_THAT(measure_text(older), HasSubstr("wake-up"));
}

TEST(MeasurePage, ShowsThePeerToolsBesideTheLoop) {
    PeerResult cyclictest;
    PeerResult timerlat;
    PeerResult osnoise;
    for (int i = 1; i <= 50; ++i) {
        cyclictest.wakeup.record(std::int64_t{2000} * i);
        timerlat.wakeup.record(std::int64_t{1500} * i);
    }
    osnoise.missing = "<install> it";
    std::vector<MeasuredPeer> peers;
    for (const PeerTool& tool : peer_tools()) {
        peers.push_back({&tool, tool.name == "cyclictest" ? &cyclictest
                                : tool.name == "timerlat" ? &timerlat
                                                          : &osnoise});
    }
    const std::string page = measure_page(report_of(100, "a device", {}, peers), kRedraw);
    EXPECT_THAT(page, AllOf(HasSubstr("<td>timerlat's wake-up</td>"), HasSubstr("<td>timerlat / cyclictest</td>"),
                            HasSubstr("osnoise was not run: &lt;install&gt; it")));
    if (!has_gnuplot()) {
        GTEST_SKIP() << "there is no gnuplot: package gnuplot-nox";
    }
    std::map<std::string, int> names;
    for (const PlotLabel& label : plot_labels(page)) {
        ++names[label.text];
    }
    EXPECT_EQ(names["cyclictest"], 1) << "over the histogram of the wake-up";
    EXPECT_EQ(names["timerlat"], 1);
    EXPECT_EQ(names["osnoise"], 0);
}

TEST(MeasurePage, KeepsAllLabelsWithinThePlots) {
    if (!has_gnuplot()) {
        GTEST_SKIP() << "there is no gnuplot: package gnuplot-nox";
    }
    // 10,000 ticks have a label "99.99 %" at the right end of their tails.
    const std::vector<PlotLabel> labels = plot_labels(measure_page(report_of(10'000), kRedraw));
    EXPECT_EQ(std::count_if(labels.begin(), labels.end(), [](const auto& label) { return label.text == "99.99 %"; }),
              1);
    for (const PlotLabel& label : labels) {
        EXPECT_GE(label.from, 0.0) << label.text;
        EXPECT_LE(label.to, kPlotWidth) << label.text;
    }
}

TEST(MeasurePage, DrawsOneBarPerDistinctValue) {
    if (!has_gnuplot()) {
        GTEST_SKIP() << "there is no gnuplot: package gnuplot-nox";
    }
    // A single value of 1 us is a single bar, which gnuplot draws as a polygon.
    const std::string one = measure_page(report_of(1), kRedraw);
    EXPECT_EQ(times(one, "<polygon "), 2U) << "one of wake-up, one of compute";
    const std::string two = measure_page(report_of(2), kRedraw);
    EXPECT_EQ(times(two, "<polygon "), 3U);
}

TEST(MeasurePage, DrawsThePeriodAroundTheNominalOneInTenthsOfAMicrosecond) {
    if (!has_gnuplot()) {
        GTEST_SKIP() << "there is no gnuplot: package gnuplot-nox";
    }
    // Three periods in the bucket of the nominal one, one in the next, one out of sight.
    const std::vector<std::int64_t> periods_ns = {1'000'000, 1'000'030, 999'960, 1'000'100, 1'400'000};
    const std::string page = measure_page(report_of(1, "a device", periods_ns), kRedraw);
    EXPECT_EQ(times(page, "<polygon "), 4U) << "one of wake-up, one of compute, two of the period";
    EXPECT_THAT(page, HasSubstr("Nominal 1,000 us, 1 beyond 100 us to either side."));
    const std::vector<PlotLabel> labels = plot_labels(page);
    EXPECT_TRUE(std::any_of(labels.begin(), labels.end(),
                            [](const auto& label) { return label.text == "period less the nominal one, us"; }));
    const std::string compared =
        comparison_page(report_of(1, "a device", periods_ns), report_of(1, "a device", {1'000'000}), kRedraw);
    EXPECT_THAT(compared, HasSubstr("first: nominal 1,000 us, 1 beyond 100 us to either side. second: nominal"));
}

TEST(MeasurePage, IsCompleteWithoutGnuplotAndSaysHowToDrawThePlots) {
    const nlohmann::json report = report_of(100);
    const std::string drawn = measure_page(report, kRedraw);
    const NoPrograms none;
    const std::string page = measure_page(report, kRedraw);
    EXPECT_EQ(times(page, "gnuplot is missing"), 5U);
    EXPECT_EQ(times(page, kRedraw), 5U);
    EXPECT_EQ(times(page, "<svg "), 0U);
    EXPECT_EQ(times(page, "<td"), times(drawn, "<td"));
    EXPECT_EQ(times(page, "<figcaption>"), times(drawn, "<figcaption>"));
    EXPECT_THAT(page, HasSubstr("</html>"));
}

TEST(MeasurePage, CanShowARunWithoutTicks) {
    const std::string page = measure_page(report_of(0), kRedraw);
    EXPECT_THAT(page, AllOf(HasSubstr("none"), Not(HasSubstr("<figure"))));
}

TEST(MeasurePage, EscapesTextFromTheReport) {
    const std::string page = measure_page(report_of(3, "a <b>\"board\"</b> & more"), kRedraw);
    EXPECT_THAT(page, HasSubstr("a &lt;b&gt;&quot;board&quot;&lt;/b&gt; &amp; more"));
    EXPECT_THAT(page, Not(HasSubstr("<b>")));
}

TEST(MeasurePage, DrawsTheSecondReportOverTheFirst) {
    const std::string page = comparison_page(report_of(50), report_of(80), kRedraw);
    EXPECT_EQ(times(page, "<figure class=\"gnuplot\">"), 2U);
    EXPECT_THROW((void)comparison_page(report_of(1), nlohmann::json::object(), kRedraw), std::runtime_error);
    EXPECT_THROW((void)measure_page(nlohmann::json::object(), kRedraw), std::runtime_error);
    if (!has_gnuplot()) {
        GTEST_SKIP() << "there is no gnuplot: package gnuplot-nox";
    }
    EXPECT_EQ(times(page, "<svg "), 2U);
    // Each plot names both reports in its key.
    std::map<std::string, int> names;
    for (const PlotLabel& label : plot_labels(page)) {
        ++names[label.text];
    }
    EXPECT_EQ(names["first"], 2);
    EXPECT_EQ(names["second"], 2);
}

}  // namespace
}  // namespace haptic::rt
