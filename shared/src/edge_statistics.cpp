#include "haptic/edge_capture.hpp"

namespace haptic {
namespace {

/// ns, since the last deadline not after an instant.
std::int64_t after_deadline(std::int64_t time_ns, const EdgeExpectation& expected) {
    const std::int64_t phase_ns = (time_ns - expected.deadline_ns) % expected.period_ns;
    return phase_ns < 0 ? phase_ns + expected.period_ns : phase_ns;
}

/// The last rising edge, if it may still be measured from.
struct Reference {
    std::int64_t rise_ns = -1;  // -1: none
    bool whole = false;         // a falling edge came after it
};

void take_rise(EdgeStatistics& statistics, Reference& last, std::int64_t time_ns, const EdgeExpectation& expected) {
    ++statistics.rising;
    if (expected.deadline_ns >= 0) {
        statistics.lateness.record(after_deadline(time_ns, expected));
    }
    if (last.rise_ns >= 0 && (last.whole || expected.kind == EdgeKind::Rising)) {
        const std::int64_t period_ns = time_ns - last.rise_ns;
        statistics.longest_at_ns = period_ns > statistics.period.max_ns() ? time_ns : statistics.longest_at_ns;
        statistics.long_periods += 2 * period_ns >= 3 * expected.period_ns ? 1u : 0u;
        statistics.period.record(period_ns);
    }
    last = {time_ns, false};
}

void take_fall(EdgeStatistics& statistics, Reference& last, std::int64_t time_ns) {
    ++statistics.falling;
    if (last.rise_ns >= 0 && !last.whole) {
        statistics.high.record(time_ns - last.rise_ns);
        last.whole = true;
    } else {
        last = {};  // of the rise between nothing is known
    }
}

}  // namespace

EdgeStatistics edge_statistics(std::span<const Edge> edges, const EdgeExpectation& expected) {
    EdgeStatistics statistics;
    Reference last;
    const Edge* before = nullptr;
    for (const Edge& edge : edges) {
        const bool again = before != nullptr && before->rising == edge.rising;
        statistics.lost += again && expected.kind == EdgeKind::Both ? 1u : 0u;
        if (edge.rising) {
            take_rise(statistics, last, edge.time_ns, expected);
        } else {
            take_fall(statistics, last, edge.time_ns);
        }
        before = &edge;
    }
    if (!edges.empty()) {
        statistics.first_ns = edges.front().time_ns;
        statistics.last_ns = edges.back().time_ns;
    }
    return statistics;
}

}  // namespace haptic
