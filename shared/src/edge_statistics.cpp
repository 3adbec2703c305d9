#include "haptic/edge_capture.hpp"

namespace haptic {
namespace {

/// Time since the last deadline at or before `time_ns`, ns: the time modulo the period.
std::int64_t after_deadline(std::int64_t time_ns, const EdgeExpectation& expected) {
    const std::int64_t phase_ns = (time_ns - expected.deadline_ns) % expected.period_ns;
    return phase_ns < 0 ? phase_ns + expected.period_ns : phase_ns;
}

/// The last rising edge, if measurements may start from it.
struct LastRise {
    std::int64_t rise_ns = -1;  // -1: none
    bool fallen = false;        // its falling edge was seen
};

void take_rise(EdgeStatistics& statistics, LastRise& last, std::int64_t time_ns, const EdgeExpectation& expected) {
    // Lateness of the edge within its period.
    ++statistics.rising;
    if (expected.deadline_ns >= 0) {
        statistics.lateness.record(after_deadline(time_ns, expected));
    }
    // Period since the last rise. With both edges captured, a missing fall in between means that edges were lost.
    if (last.rise_ns >= 0 && (last.fallen || expected.kind == EdgeKind::Rising)) {
        const std::int64_t period_ns = time_ns - last.rise_ns;
        statistics.longest_at_ns = period_ns > statistics.period.max_ns() ? time_ns : statistics.longest_at_ns;
        statistics.long_periods += 2 * period_ns >= 3 * expected.period_ns ? 1u : 0u;
        statistics.period.record(period_ns);
    }
    last = {time_ns, false};
}

void take_fall(EdgeStatistics& statistics, LastRise& last, std::int64_t time_ns) {
    ++statistics.falling;
    if (last.rise_ns >= 0 && !last.fallen) {
        // High time: how long the loop worked.
        statistics.high.record(time_ns - last.rise_ns);
        last.fallen = true;
    } else {
        last = {};  // a second fall: the rise in between was lost
    }
}

}  // namespace

EdgeStatistics edge_statistics(std::span<const Edge> edges, const EdgeExpectation& expected) {
    EdgeStatistics statistics;
    LastRise last;
    const Edge* before = nullptr;
    for (const Edge& edge : edges) {
        // Two edges in the same direction: one in between was lost.
        const bool same_direction = before != nullptr && before->rising == edge.rising;
        statistics.lost += same_direction && expected.kind == EdgeKind::Both ? 1u : 0u;
        // Lateness and period of a rise, high time of a fall.
        if (edge.rising) {
            take_rise(statistics, last, edge.time_ns, expected);
        } else {
            take_fall(statistics, last, edge.time_ns);
        }
        before = &edge;
    }
    // Time span of the capture.
    if (!edges.empty()) {
        statistics.first_ns = edges.front().time_ns;
        statistics.last_ns = edges.back().time_ns;
    }
    return statistics;
}

}  // namespace haptic
