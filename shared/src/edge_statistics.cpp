#include "haptic/edge_capture.hpp"

namespace haptic {
namespace {

/// Time since the last deadline at or before `time_ns`, ns: the time modulo the period.
std::int64_t after_deadline(std::int64_t time_ns, const EdgeExpectation& expected) {
    const std::int64_t phase_ns = (time_ns - expected.deadline_ns) % expected.period_ns;
    return phase_ns < 0 ? phase_ns + expected.period_ns : phase_ns;
}

}  // namespace

void EdgeMeter::take_rise(std::int64_t time_ns) {
    // Lateness of the edge within its period.
    ++statistics_.rising;
    if (expected_.deadline_ns >= 0) {
        statistics_.lateness.record(after_deadline(time_ns, expected_));
    }
    // Period since the last rise. With both edges captured, a missing fall in between means that edges were lost.
    if (rise_ns_ >= 0 && (fallen_ || expected_.kind == EdgeKind::Rising)) {
        const std::int64_t period_ns = time_ns - rise_ns_;
        statistics_.longest_at_ns = period_ns > statistics_.period.max_ns() ? time_ns : statistics_.longest_at_ns;
        statistics_.long_periods += 2 * period_ns >= 3 * expected_.period_ns ? 1u : 0u;
        statistics_.period.record(period_ns);
    }
    rise_ns_ = time_ns;
    fallen_ = false;
}

void EdgeMeter::take_fall(std::int64_t time_ns) {
    ++statistics_.falling;
    if (rise_ns_ >= 0 && !fallen_) {
        // High time: how long the loop worked.
        statistics_.high.record(time_ns - rise_ns_);
        fallen_ = true;
    } else {
        rise_ns_ = -1;  // a second fall: the rise in between was lost
        fallen_ = false;
    }
}

void EdgeMeter::add(std::span<const Edge> edges) {
    for (const Edge& edge : edges) {
        // Two edges in the same direction: one in between was lost.
        const bool is_first = statistics_.rising + statistics_.falling == 0;
        const bool same_direction = !is_first && was_rising_ == edge.rising;
        statistics_.lost += same_direction && expected_.kind == EdgeKind::Both ? 1u : 0u;
        statistics_.first_ns = is_first ? edge.time_ns : statistics_.first_ns;
        statistics_.last_ns = edge.time_ns;
        was_rising_ = edge.rising;
        // Lateness and period of a rise, high time of a fall.
        if (edge.rising) {
            take_rise(edge.time_ns);
        } else {
            take_fall(edge.time_ns);
        }
    }
}

}  // namespace haptic
