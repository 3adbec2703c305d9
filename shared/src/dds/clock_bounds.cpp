#include "dds/clock_bounds.hpp"

#include <algorithm>
#include <cmath>

namespace haptic {
namespace {

constexpr std::int64_t kDriftAfterNs = 10'000'000'000;
// Exchanges until the bounds have narrowed.
constexpr std::uint64_t kNarrowAfter = 20;

}  // namespace

ClockBounds::Bounds ClockBounds::bounds_at(std::int64_t now_ns) const noexcept {
    // Drift acts in both directions of time.
    const auto growth_ns =
        static_cast<std::int64_t>(std::ceil(kMaxDrift * static_cast<double>(std::abs(now_ns - bounds_.at_ns))));
    return {bounds_.low_ns - growth_ns, bounds_.high_ns + growth_ns, now_ns};
}

bool ClockBounds::add(const ClockExchange& exchange) noexcept {
    const std::int64_t here_ns = exchange.returned_ns - exchange.sent_ns;
    const std::int64_t there_ns = exchange.replied_ns - exchange.received_ns;
    if (here_ns < 0 || there_ns < 0 || here_ns < there_ns) {
        return false;
    }
    // The first bound was measured as long ago as the exchange took.
    const auto drift_ns = static_cast<std::int64_t>(std::ceil(kMaxDrift * static_cast<double>(here_ns)));
    const Bounds found{exchange.replied_ns - exchange.returned_ns, exchange.received_ns - exchange.sent_ns + drift_ns,
                       exchange.returned_ns};
    shortest_ns_ = exchanges_ == 0 ? here_ns - there_ns : std::min(shortest_ns_, here_ns - there_ns);
    const Bounds known = bounds_at(found.at_ns);
    bounds_ = {std::max(known.low_ns, found.low_ns), std::min(known.high_ns, found.high_ns), found.at_ns};
    const bool contradicts = exchanges_ > 0 && bounds_.low_ns > bounds_.high_ns;
    if (exchanges_ == 0 || contradicts) {
        bounds_ = found;
        since_restart_ = 0;
        restarts_ += contradicts ? 1u : 0u;
    }
    if (since_restart_ < kNarrowAfter) {
        first_ = bounds_;
    }
    ++since_restart_;
    ++exchanges_;
    return true;
}

std::optional<ClockOffset> ClockBounds::at(std::int64_t now_ns) const noexcept {
    if (exchanges_ == 0) {
        return std::nullopt;
    }
    const Bounds now = bounds_at(now_ns);
    const std::int64_t half_ns = (now.high_ns - now.low_ns + 1) / 2;
    return ClockOffset{.offset_ns = now.low_ns + half_ns, .uncertainty_ns = half_ns};
}

std::optional<double> ClockBounds::drift() const noexcept {
    const std::int64_t elapsed_ns = bounds_.at_ns - first_.at_ns;
    if (exchanges_ == 0 || elapsed_ns < kDriftAfterNs) {
        return std::nullopt;
    }
    const std::int64_t moved_ns = (bounds_.low_ns + bounds_.high_ns) / 2 - (first_.low_ns + first_.high_ns) / 2;
    return static_cast<double>(moved_ns) / static_cast<double>(elapsed_ns);
}

}  // namespace haptic
