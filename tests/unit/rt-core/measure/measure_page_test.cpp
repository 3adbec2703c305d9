#include "measure/measure_page.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <regex>
#include <stdexcept>
#include <string>

#include "measure/measure_report.hpp"
#include "measure/svg_plot.hpp"

namespace haptic::rt {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

std::size_t times(const std::string& text, const std::string& part) {
    std::size_t count = 0;
    for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) {
        ++count;
    }
    return count;
}

/// A report of this many ticks; 0 leaves all distributions empty.
nlohmann::json report_of(int ticks, const std::string& device = "a device") {
    const auto instruments = std::make_unique<Instruments>();
    const auto log = std::make_unique<TimingLog>();
    RunResult result;
    result.device = device;
    for (int i = 1; i <= ticks; ++i) {
        TickRecord record;
        record.number = instruments->ticks = static_cast<std::uint64_t>(i);
        record.deadline_ns = i * 1'000'000;
        record.now_ns = record.deadline_ns + 1000 * i;
        record.compute_ns = 5000;
        instruments->wakeup.record(1000 * i);
        instruments->compute.record(5000);
        log->add(record, {}, 0);
    }
    const KernelWatch kernel(0, "/nowhere");
    return make_measure_report(
        {.result = &result, .instruments = instruments.get(), .log = log.get(), .kernel = &kernel});
}

TEST(MeasurePage, DrawsEachDistributionWithValues) {
    const std::string page = measure_page(report_of(100));
    EXPECT_EQ(times(page, "<svg "), 4U) << "tails, course, wake-up and compute";
    EXPECT_EQ(times(page, "<svg "), times(page, "</svg>"));
    EXPECT_THAT(page, Not(AllOf(HasSubstr("nan"), HasSubstr("inf"))));
    EXPECT_THAT(page, Not(HasSubstr("<script")));
}

TEST(SvgPlot, KeepsALabelAtTheEdgeOfTheAxisWithinThePicture) {
    SvgPlot plot({1.0, 10.0}, {1.0, 10.0}, "x", "y");
    plot.set_x_ticks({{10.0, "99.99 %"}});
    const std::string svg = plot.svg("title");
    std::smatch found;
    const std::regex label(R"svg(<text x="([0-9.]+)"[^>]*>99\.99 %)svg");
    ASSERT_TRUE(std::regex_search(svg, found, label));
    // The picture is 720 wide; at its 12 px a character of the page's font is at most 7 wide.
    EXPECT_LE(std::stod(found[1]) + 7.0 * 7 / 2.0, 720.0);
}

TEST(MeasurePage, DrawsOneBarPerDistinctValue) {
    // A single value of 1 us is a single bar.
    const std::string one = measure_page(report_of(1));
    EXPECT_EQ(times(one, "<rect class=\"first\" "), 2U) << "one of wake-up, one of compute";
    const std::string two = measure_page(report_of(2));
    EXPECT_EQ(times(two, "<rect class=\"first\" "), 3U);
}

TEST(MeasurePage, CanShowARunWithoutTicks) {
    const std::string page = measure_page(report_of(0));
    EXPECT_THAT(page, AllOf(HasSubstr("none"), Not(HasSubstr("nan"))));
}

TEST(MeasurePage, EscapesTextFromTheReport) {
    const std::string page = measure_page(report_of(3, "a <b>\"board\"</b> & more"));
    EXPECT_THAT(page, HasSubstr("a &lt;b&gt;&quot;board&quot;&lt;/b&gt; &amp; more"));
    EXPECT_THAT(page, Not(HasSubstr("<b>")));
}

TEST(MeasurePage, DrawsTheSecondReportOverTheFirst) {
    const std::string page = comparison_page(report_of(50), report_of(80));
    EXPECT_EQ(times(page, "<svg "), 2U);
    EXPECT_EQ(times(page, "<path class=\"second\""), 2U);
    EXPECT_THROW((void)comparison_page(report_of(1), nlohmann::json::object()), std::runtime_error);
    EXPECT_THROW((void)measure_page(nlohmann::json::object()), std::runtime_error);
}

}  // namespace
}  // namespace haptic::rt
