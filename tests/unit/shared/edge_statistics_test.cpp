#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "haptic/edge_capture.hpp"

namespace haptic {
namespace {

constexpr std::int64_t kPeriodNs = 1'000'000;
constexpr std::int64_t kStartNs = 77'000'000;

/// Edges of a loop that wakes up some time after each deadline and works for some time.
struct Loop {
    std::vector<Edge> edges;
    std::vector<std::int64_t> late_ns;
    std::vector<std::int64_t> work_ns;
};

Loop loop_of(int ticks, unsigned seed) {
    std::mt19937_64 random(seed);
    Loop loop;
    for (int i = 0; i < ticks; ++i) {
        loop.late_ns.push_back(static_cast<std::int64_t>(random() % 40'000));
        loop.work_ns.push_back(3'000 + static_cast<std::int64_t>(random() % 200'000));
        const std::int64_t rise_ns = kStartNs + i * kPeriodNs + loop.late_ns.back();
        loop.edges.push_back({rise_ns, true});
        loop.edges.push_back({rise_ns + loop.work_ns.back(), false});
    }
    return loop;
}

/// Of edges that come a few at a time.
EdgeStatistics edge_statistics(std::span<const Edge> edges, const EdgeExpectation& expected) {
    EdgeMeter meter(expected);
    for (std::size_t at = 0; at < edges.size(); at += 7) {
        meter.add(edges.subspan(at, std::min<std::size_t>(7, edges.size() - at)));
    }
    return meter.statistics();
}

TEST(EdgeStatistics, AreThoseOfTheLoopThatMadeTheEdges) {
    const Loop loop = loop_of(5000, 3);
    const EdgeStatistics found = edge_statistics(loop.edges, {.period_ns = kPeriodNs, .deadline_ns = kStartNs});
    PeriodHistogram period(kPeriodNs);
    Histogram high;
    Histogram lateness;
    for (std::size_t i = 0; i < loop.late_ns.size(); ++i) {
        high.record(loop.work_ns[i]);
        lateness.record(loop.late_ns[i]);
        if (i > 0) {
            period.record(kPeriodNs + loop.late_ns[i] - loop.late_ns[i - 1]);
        }
    }
    const auto expect_same = [](const auto& is, const auto& expected) {
        EXPECT_EQ(is.count(), expected.count());
        EXPECT_EQ(is.min_ns(), expected.min_ns());
        EXPECT_EQ(is.max_ns(), expected.max_ns());
        EXPECT_EQ(is.percentile_ns(0.99), expected.percentile_ns(0.99));
        EXPECT_EQ(is.mean_ns(), expected.mean_ns());
    };
    expect_same(found.period, period);
    expect_same(found.high, high);
    expect_same(found.lateness, lateness);
    EXPECT_EQ(found.rising, 5000u);
    EXPECT_EQ(found.falling, 5000u);
    EXPECT_EQ(found.lost, 0u);
    EXPECT_EQ(found.long_periods, 0u);
    EXPECT_EQ(found.first_ns, loop.edges.front().time_ns);
    EXPECT_EQ(found.last_ns, loop.edges.back().time_ns);
}

TEST(EdgeStatistics, KnowNoLatenessWithoutADeadline) {
    EXPECT_EQ(edge_statistics(loop_of(10, 1).edges, {.period_ns = kPeriodNs}).lateness.count(), 0u);
}

TEST(EdgeStatistics, CountLatenessFromTheDeadlineBeforeAlsoOfEdgesBeforeTheKnownOne) {
    const std::vector<Edge> edges = {{kStartNs - 10 * kPeriodNs + 250, true}};
    const EdgeStatistics found = edge_statistics(edges, {.period_ns = kPeriodNs, .deadline_ns = kStartNs});
    EXPECT_EQ(found.lateness.max_ns(), 250);
}

TEST(EdgeStatistics, FollowALoopThatIsStartedAgain) {
    EdgeMeter meter({.period_ns = kPeriodNs});
    meter.add(std::vector<Edge>{{kStartNs + 100, true}});
    EXPECT_EQ(meter.statistics().lateness.count(), 0U);
    for (const std::int64_t deadline_ns : {kStartNs, kStartNs + 10 * kPeriodNs + 333'333}) {
        meter.expect_deadline(deadline_ns);
        meter.add(std::vector<Edge>{{deadline_ns + 5 * kPeriodNs + 250, true}});
    }
    EXPECT_EQ(meter.statistics().lateness.count(), 2U);
    EXPECT_EQ(meter.statistics().lateness.max_ns(), 250);
}

TEST(EdgeStatistics, LeaveOutWhatALostEdgeMadeLonger) {
    Loop loop = loop_of(100, 5);
    const EdgeStatistics whole = edge_statistics(loop.edges, {.period_ns = kPeriodNs});
    loop.edges.erase(loop.edges.begin() + 2 * 40);  // the rising edge of tick 40
    loop.edges.erase(loop.edges.begin() + 2 * 70);  // the falling edge of tick 70
    const EdgeStatistics found = edge_statistics(loop.edges, {.period_ns = kPeriodNs});
    EXPECT_EQ(found.lost, 2u);
    EXPECT_EQ(found.rising, 99u);
    EXPECT_EQ(found.falling, 99u);
    EXPECT_EQ(found.high.count(), 98u) << "not of ticks 40 and 70";
    EXPECT_EQ(found.period.count(), 96u) << "not into 40, out of 40, or out of 70";
    EXPECT_LE(found.high.max_ns(), whole.high.max_ns());
    EXPECT_LE(found.period.max_ns(), whole.period.max_ns());
    EXPECT_EQ(found.long_periods, 0u);
}

TEST(EdgeStatistics, SayWhenTheLongestPeriodWas) {
    Loop loop = loop_of(100, 5);
    loop.edges.erase(loop.edges.begin() + 2 * 40, loop.edges.begin() + 2 * 43);  // three skipped ticks
    const EdgeStatistics found = edge_statistics(loop.edges, {.period_ns = kPeriodNs});
    EXPECT_EQ(found.lost, 0u);
    EXPECT_EQ(found.long_periods, 1u);
    EXPECT_EQ(found.longest_at_ns, loop.edges[2 * 40].time_ns);
    EXPECT_GT(found.period.max_ns(), 3 * kPeriodNs);
}

TEST(EdgeStatistics, OfRisingEdgesAloneAreTheSameButForTheTimeUp) {
    const Loop loop = loop_of(1000, 9);
    std::vector<Edge> rising;
    std::copy_if(loop.edges.begin(), loop.edges.end(), std::back_inserter(rising),
                 [](const Edge& edge) { return edge.rising; });
    const EdgeExpectation both{.period_ns = kPeriodNs, .deadline_ns = kStartNs};
    EdgeExpectation one = both;
    one.kind = EdgeKind::Rising;
    const EdgeStatistics expected = edge_statistics(loop.edges, both);
    const EdgeStatistics found = edge_statistics(rising, one);
    EXPECT_EQ(found.period.count(), 999u);
    EXPECT_EQ(found.period.max_ns(), expected.period.max_ns());
    EXPECT_EQ(found.period.mean_ns(), expected.period.mean_ns());
    EXPECT_EQ(found.lateness.percentile_ns(0.9), expected.lateness.percentile_ns(0.9));
    EXPECT_EQ(found.lost, 0u);
    EXPECT_EQ(found.falling, 0u);
    EXPECT_EQ(found.high.count(), 0u);
}

TEST(EdgeStatistics, OfNothingAreEmpty) {
    const EdgeStatistics found = edge_statistics({}, {});
    EXPECT_EQ(found.rising + found.falling + found.lost + found.period.count(), 0u);
}

TEST(EdgeStatistics, BeginWithWhateverEdgeIsFirst) {
    const std::vector<Edge> edges = {{100, false}, {1'000'100, true}, {1'000'400, false}, {2'000'100, true}};
    const EdgeStatistics found = edge_statistics(edges, {.period_ns = kPeriodNs});
    EXPECT_EQ(found.lost, 0u);
    EXPECT_EQ(found.period.count(), 1u);
    EXPECT_EQ(found.period.max_ns(), 1'000'000);
    EXPECT_EQ(found.high.max_ns(), 300);
}

}  // namespace
}  // namespace haptic
