#include "view/device_telemetry.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "haptic/workspace_region.hpp"

namespace haptic::sim::view {
namespace {

constexpr std::int64_t kFutureNs = 1'000'000'000;      // a latch this far after our poll is not a valid time
constexpr std::int64_t kRateWindowNs = 1'000'000'000;  // over which the tick rate is measured
constexpr auto kBins = static_cast<std::int64_t>(DeviceTelemetry::kBins);
constexpr std::int64_t kFinestBinNs = 100;
constexpr double kBulk = 0.99;  // of the periods; the bins reach twice as far, the outer ones take the rest
constexpr std::int64_t kJitterDivisor = 32;  // 1/32 of a period: the usual lateness of a latch

double microseconds(std::int64_t ns) {
    return static_cast<double>(ns) * 1e-3;
}

double milliseconds(std::int64_t ns) {
    return static_cast<double>(ns) * 1e-6;
}

/// The smallest value that at least this fraction of the sorted values does not exceed; 0 if there are none.
std::int64_t percentile(const std::vector<std::int64_t>& sorted, double fraction) {
    if (sorted.empty()) {
        return 0;
    }
    const double rank = std::ceil(fraction * static_cast<double>(sorted.size()));
    return sorted[std::min(sorted.size(), static_cast<std::size_t>(std::max(rank, 1.0))) - 1];
}

/// The smallest of 1, 2, 5, 10, 20, ... times kFinestBinNs with which half the bins cover a deviation.
std::int64_t bin_width(std::int64_t deviation_ns) {
    for (std::int64_t decade = kFinestBinNs;; decade *= 10) {
        for (const std::int64_t mantissa : {1, 2, 5}) {
            if (kBins / 2 * mantissa >= deviation_ns / decade + 1) {
                return mantissa * decade;
            }
        }
    }
}

nlohmann::json histogram(const std::vector<std::int64_t>& sorted) {
    nlohmann::json edges = nlohmann::json::array();
    nlohmann::json counts = nlohmann::json::array();
    if (!sorted.empty()) {
        const std::int64_t median = percentile(sorted, 0.5);
        // Centre the bins on the median; their width follows from the 1st and 99th percentiles.
        const std::int64_t deviation =
            2 * std::max(percentile(sorted, kBulk) - median, median - percentile(sorted, 1.0 - kBulk));
        const std::int64_t width = bin_width(deviation);
        const std::int64_t first = std::max<std::int64_t>(median / width - kBins / 2, 0);
        // Values beyond the ends go into the outer bins.
        std::array<std::uint64_t, DeviceTelemetry::kBins> bins{};
        for (const std::int64_t value : sorted) {
            const std::int64_t bin = std::clamp<std::int64_t>(value / width - first, 0, kBins - 1);
            bins[static_cast<std::size_t>(bin)] += 1;
        }
        for (std::int64_t i = 0; i <= kBins; ++i) {
            edges.push_back(microseconds((first + i) * width));
        }
        counts = bins;
    }
    return {{"edges", edges},
            {"counts", counts},
            {"p50", microseconds(percentile(sorted, 0.5))},
            {"p99", microseconds(percentile(sorted, 0.99))},
            {"max", microseconds(percentile(sorted, 1.0))}};
}

/// Deadlines that passed without a latch. A loop that keeps its phase and wakes 1.9 periods late has missed one
/// deadline; its latch comes 2.9 periods after the one before, or slightly less, since that one was late by its usual
/// jitter.
std::uint64_t missed_ticks(const std::vector<std::int64_t>& sorted_periods) {
    const std::int64_t median = percentile(sorted_periods, 0.5);
    std::uint64_t missed = 0;
    for (auto period = sorted_periods.rbegin(); period != sorted_periods.rend(); ++period) {
        const std::int64_t ticks = (*period + median / kJitterDivisor) / median;
        if (ticks < 2) {
            break;
        }
        missed += static_cast<std::uint64_t>(ticks - 1);
    }
    return missed;
}

}  // namespace

// Release stores and acquire loads: a reader that sees the time of a newer frame also sees that the sequence changed.
void PublishTimes::add(std::uint64_t sequence, std::int64_t time_ns) noexcept {
    Entry& entry = entries_[sequence % kFrames];
    entry.sequence.store(0, std::memory_order_release);
    entry.time_ns.store(time_ns, std::memory_order_release);
    entry.sequence.store(sequence, std::memory_order_release);
}

std::optional<std::int64_t> PublishTimes::find(std::uint64_t sequence) const noexcept {
    const Entry& entry = entries_[sequence % kFrames];
    if (sequence == 0 || entry.sequence.load(std::memory_order_acquire) != sequence) {
        return std::nullopt;
    }
    const std::int64_t time_ns = entry.time_ns.load(std::memory_order_acquire);
    return entry.sequence.load(std::memory_order_acquire) == sequence ? std::optional(time_ns) : std::nullopt;
}

DeviceTelemetry::DeviceTelemetry(const std::string& session) : session_name_(session), observer_(session) {}

void DeviceTelemetry::poll(std::int64_t now_ns) {
    if (now_ns - polled_ns_ > kPauseNs) {
        ticks_.clear();  // nobody was watching: do not count the gap as unseen
    }
    polled_ns_ = now_ns;
    DeviceState state{};
    while (observer_.next(state)) {
        add_state(state, now_ns);
    }
    observer_.attend(now_ns);
}

void DeviceTelemetry::add_state(const DeviceState& state, std::int64_t now_ns) {
    // Ignore states with an impossible latch time.
    if (state.latch_time_ns <= 0 || state.latch_time_ns > now_ns + kFutureNs) {
        return;
    }
    // Another run of rt-core restarts the window.
    if (state.session != session_ || (!ticks_.empty() && state.sequence <= ticks_.back().sequence)) {
        ticks_.clear();
        session_ = state.session;
    }
    // A period needs two consecutive states.
    Tick tick{.latch_ns = state.latch_time_ns, .sequence = state.sequence, .period_ns = {}, .frame_age_ns = {}};
    tick.unanswered = (state.tick_flags & HAPTIC_TICK_EXCHANGE_FAILED) != 0;
    if (!ticks_.empty() && state.sequence == ticks_.back().sequence + 1 && tick.latch_ns > ticks_.back().latch_ns) {
        tick.period_ns = tick.latch_ns - ticks_.back().latch_ns;
    }
    if (const std::optional<std::int64_t> published_ns = published_.find(state.frame_sequence)) {
        // A tick latches before it takes the newest frame, so a frame published in between has age 0.
        tick.frame_age_ns = std::max<std::int64_t>(tick.latch_ns - *published_ns, 0);
    }
    ticks_.push_back(tick);
    drop_before(tick.latch_ns - kWindowNs);
    safety_state_ = state.safety_state;
    faults_ = state.faults;
    flags_ |= state.tick_flags;
}

void DeviceTelemetry::drop_before(std::int64_t time_ns) {
    while (!ticks_.empty() && (ticks_.front().latch_ns < time_ns || ticks_.size() > kMaxStates)) {
        ticks_.pop_front();
    }
}

double DeviceTelemetry::rate_hz() const {
    const Tick& newest = ticks_.back();
    const auto oldest = std::find_if(ticks_.begin(), ticks_.end(), [&newest](const Tick& tick) {
        return tick.latch_ns >= newest.latch_ns - kRateWindowNs;
    });
    const std::int64_t span_ns = newest.latch_ns - oldest->latch_ns;
    return span_ns > 0 ? static_cast<double>(newest.sequence - oldest->sequence) / (static_cast<double>(span_ns) * 1e-9)
                       : 0.0;
}

nlohmann::json DeviceTelemetry::region_in(const std::optional<DeviceInScene>& device) const {
    const std::optional<WorkspaceRegion> region = device ? read_region(session_name_) : std::nullopt;
    if (!region) {
        return nullptr;
    }
    const Vec3 axes = device->scale * region->semi_axes;
    const Vec3& centre = device->centre;
    const Quat& turned = device->orientation;
    return {{"centre", {centre.x, centre.y, centre.z}},
            {"semi_axes", {axes.x, axes.y, axes.z}},
            {"orientation", {turned.w, turned.x, turned.y, turned.z}},
            {"angle_rad", region->angle}};
}

std::string DeviceTelemetry::message(std::int64_t now_ns, const std::optional<DeviceInScene>& device) {
    drop_before(now_ns - kWindowNs);
    const bool connected = !ticks_.empty() && ticks_.back().latch_ns >= now_ns - kSilenceNs;
    // Statistics of the window: periods, ages, and ticks missing between consecutive sequence numbers.
    std::vector<std::int64_t> periods;
    std::vector<std::int64_t> ages;
    std::uint64_t unseen = 0;
    std::size_t unanswered = 0;
    for (std::size_t i = 0; connected && i < ticks_.size(); ++i) {
        const Tick& tick = ticks_[i];
        if (tick.period_ns) {
            periods.push_back(*tick.period_ns);
        }
        if (tick.frame_age_ns) {
            ages.push_back(*tick.frame_age_ns);
        }
        unanswered += tick.unanswered ? 1 : 0;
        unseen += i == 0 ? 0 : tick.sequence - ticks_[i - 1].sequence - 1;
    }
    // Percentiles and the histogram need sorted values.
    std::sort(periods.begin(), periods.end());
    std::sort(ages.begin(), ages.end());
    // Without a device the state is absent, lists are empty and numbers 0.
    const nlohmann::json message = {
        {"type", "device"},
        {"connected", connected},
        {"state", connected ? safety_state_name(safety_state_) : "absent"},
        {"faults", fault_names(connected ? faults_ : 0u)},
        {"flags", tick_flag_names(connected ? flags_ : 0u)},
        {"rate_hz", connected ? rate_hz() : 0.0},
        {"window_s", static_cast<double>(kWindowNs) * 1e-9},
        {"period_us", histogram(periods)},
        {"region", connected ? region_in(device) : nlohmann::json(nullptr)},
        {"missed", missed_ticks(periods)},
        {"unanswered", connected ? static_cast<double>(unanswered) / static_cast<double>(ticks_.size()) : 0.0},
        {"unseen", unseen},
        {"frame_age_ms",
         {{"p50", milliseconds(percentile(ages, 0.5))},
          {"p99", milliseconds(percentile(ages, 0.99))},
          {"max", milliseconds(percentile(ages, 1.0))}}}};
    flags_ = 0;
    return message.dump();
}

}  // namespace haptic::sim::view
