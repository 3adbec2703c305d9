#include "view/device_telemetry.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace haptic::sim::view {
namespace {

constexpr std::int64_t kFutureNs = 1'000'000'000;      // by which a latch may be after our look; beyond, it is no time
constexpr std::int64_t kRateWindowNs = 1'000'000'000;  // over which the rate is taken
constexpr auto kBins = static_cast<std::int64_t>(DeviceTelemetry::kBins);
constexpr std::int64_t kFinestBinNs = 100;
constexpr double kUsual = 0.99;         // of the periods; the bins reach twice as far, the outer ones take the rest
constexpr std::int64_t kJitterOf = 32;  // of a period: by so much a latch is usually late

double micro(std::int64_t ns) {
    return static_cast<double>(ns) * 1e-3;
}

double milli(std::int64_t ns) {
    return static_cast<double>(ns) * 1e-6;
}

/// Of sorted values, the least that a fraction of them does not exceed; 0 of none.
std::int64_t percentile(const std::vector<std::int64_t>& sorted, double fraction) {
    if (sorted.empty()) {
        return 0;
    }
    const double rank = std::ceil(fraction * static_cast<double>(sorted.size()));
    return sorted[std::min(sorted.size(), static_cast<std::size_t>(std::max(rank, 1.0))) - 1];
}

/// The least of 1, 2, 5, 10, 20, ... times kFinestBinNs with which half the bins cover a deviation.
std::int64_t bin_width(std::int64_t deviation_ns) {
    for (std::int64_t decade = kFinestBinNs;; decade *= 10) {
        for (const std::int64_t step : {1, 2, 5}) {
            if (kBins / 2 * step >= deviation_ns / decade + 1) {
                return step * decade;
            }
        }
    }
}

nlohmann::json histogram(const std::vector<std::int64_t>& sorted) {
    nlohmann::json edges = nlohmann::json::array();
    nlohmann::json counts = nlohmann::json::array();
    if (!sorted.empty()) {
        const std::int64_t middle = percentile(sorted, 0.5);
        const std::int64_t deviation =
            2 * std::max(percentile(sorted, kUsual) - middle, middle - percentile(sorted, 1.0 - kUsual));
        const std::int64_t width = bin_width(deviation);
        const std::int64_t first = std::max<std::int64_t>(middle / width - kBins / 2, 0);
        std::array<std::uint64_t, DeviceTelemetry::kBins> bins{};
        for (const std::int64_t value : sorted) {
            const std::int64_t bin = std::clamp<std::int64_t>(value / width - first, 0, kBins - 1);
            bins[static_cast<std::size_t>(bin)] += 1;
        }
        for (std::int64_t i = 0; i <= kBins; ++i) {
            edges.push_back(micro((first + i) * width));
        }
        counts = bins;
    }
    return {{"edges", edges},
            {"counts", counts},
            {"p50", micro(percentile(sorted, 0.5))},
            {"p99", micro(percentile(sorted, 0.99))},
            {"max", micro(percentile(sorted, 1.0))}};
}

/// Deadlines that passed without a latch. A loop that keeps its phase and wakes 1.9 periods late has missed one; its
/// latch comes 2.9 periods after the one before, or a little less, since that was late by its usual jitter.
std::uint64_t missed_ticks(const std::vector<std::int64_t>& sorted_periods) {
    const std::int64_t usual = percentile(sorted_periods, 0.5);
    std::uint64_t missed = 0;
    for (auto period = sorted_periods.rbegin(); period != sorted_periods.rend(); ++period) {
        const std::int64_t ticks = (*period + usual / kJitterOf) / usual;
        if (ticks < 2) {
            break;
        }
        missed += static_cast<std::uint64_t>(ticks - 1);
    }
    return missed;
}

}  // namespace

// Release stores and acquire loads: whoever sees the time of a newer frame sees the sequence changed afterwards.
void PublishTimes::add(std::uint64_t sequence, std::int64_t time_ns) noexcept {
    Entry& entry = entries_[sequence % kFrames];
    entry.sequence.store(0, std::memory_order_release);
    entry.time_ns.store(time_ns, std::memory_order_release);
    entry.sequence.store(sequence, std::memory_order_release);
}

std::optional<std::int64_t> PublishTimes::of(std::uint64_t sequence) const noexcept {
    const Entry& entry = entries_[sequence % kFrames];
    if (sequence == 0 || entry.sequence.load(std::memory_order_acquire) != sequence) {
        return std::nullopt;
    }
    const std::int64_t time_ns = entry.time_ns.load(std::memory_order_acquire);
    return entry.sequence.load(std::memory_order_acquire) == sequence ? std::optional(time_ns) : std::nullopt;
}

DeviceTelemetry::DeviceTelemetry(const std::string& session) : observer_(session) {}

void DeviceTelemetry::look(std::int64_t now_ns) {
    if (now_ns - looked_ns_ > kPauseNs) {
        seen_.clear();  // what nobody looked at was not unseen
    }
    looked_ns_ = now_ns;
    DeviceState state{};
    while (observer_.next(state)) {
        take(state, now_ns);
    }
    observer_.attend(now_ns);
}

void DeviceTelemetry::take(const DeviceState& state, std::int64_t now_ns) {
    if (state.latch_time_ns <= 0 || state.latch_time_ns > now_ns + kFutureNs) {
        return;
    }
    if (state.session != session_ || (!seen_.empty() && state.sequence <= seen_.back().sequence)) {
        seen_.clear();
        session_ = state.session;
    }
    Seen seen{.latch_ns = state.latch_time_ns, .sequence = state.sequence, .period_ns = {}, .frame_age_ns = {}};
    if (!seen_.empty() && state.sequence == seen_.back().sequence + 1 && seen.latch_ns > seen_.back().latch_ns) {
        seen.period_ns = seen.latch_ns - seen_.back().latch_ns;
    }
    if (const std::optional<std::int64_t> published_ns = published_.of(state.frame_sequence)) {
        // A tick latches before it takes the newest frame: one that came in between has no age yet.
        seen.frame_age_ns = std::max<std::int64_t>(seen.latch_ns - *published_ns, 0);
    }
    seen_.push_back(seen);
    forget_before(seen.latch_ns - kWindowNs);
    safety_state_ = state.safety_state;
    faults_ = state.faults;
    flags_ |= state.tick_flags;
}

void DeviceTelemetry::forget_before(std::int64_t time_ns) {
    while (!seen_.empty() && (seen_.front().latch_ns < time_ns || seen_.size() > kMostStates)) {
        seen_.pop_front();
    }
}

double DeviceTelemetry::rate_hz() const {
    const Seen& newest = seen_.back();
    const auto oldest = std::find_if(seen_.begin(), seen_.end(), [&newest](const Seen& seen) {
        return seen.latch_ns >= newest.latch_ns - kRateWindowNs;
    });
    const std::int64_t span_ns = newest.latch_ns - oldest->latch_ns;
    return span_ns > 0 ? static_cast<double>(newest.sequence - oldest->sequence) / (static_cast<double>(span_ns) * 1e-9)
                       : 0.0;
}

std::string DeviceTelemetry::message(std::int64_t now_ns) {
    forget_before(now_ns - kWindowNs);
    const bool connected = !seen_.empty() && seen_.back().latch_ns >= now_ns - kSilenceNs;
    std::vector<std::int64_t> periods;
    std::vector<std::int64_t> ages;
    std::uint64_t unseen = 0;
    for (std::size_t i = 0; connected && i < seen_.size(); ++i) {
        const Seen& seen = seen_[i];
        if (seen.period_ns) {
            periods.push_back(*seen.period_ns);
        }
        if (seen.frame_age_ns) {
            ages.push_back(*seen.frame_age_ns);
        }
        unseen += i == 0 ? 0 : seen.sequence - seen_[i - 1].sequence - 1;
    }
    std::sort(periods.begin(), periods.end());
    std::sort(ages.begin(), ages.end());
    const nlohmann::json message = {{"type", "device"},
                                    {"connected", connected},
                                    {"state", connected ? safety_state_name(safety_state_) : "absent"},
                                    {"faults", fault_names(connected ? faults_ : 0u)},
                                    {"flags", tick_flag_names(connected ? flags_ : 0u)},
                                    {"rate_hz", connected ? rate_hz() : 0.0},
                                    {"window_s", static_cast<double>(kWindowNs) * 1e-9},
                                    {"period_us", histogram(periods)},
                                    {"missed", missed_ticks(periods)},
                                    {"unseen", unseen},
                                    {"frame_age_ms",
                                     {{"p50", milli(percentile(ages, 0.5))},
                                      {"p99", milli(percentile(ages, 0.99))},
                                      {"max", milli(percentile(ages, 1.0))}}}};
    flags_ = 0;
    return message.dump();
}

}  // namespace haptic::sim::view
