#include "measure/trial_rig.hpp"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <numeric>
#include <stdexcept>

namespace haptic::rt {
namespace {

std::int64_t frozen_clock() HAPTIC_RT {
    return 0;
}

TickSettings with_short_arming(TickSettings settings) {
    settings.safety.tension_ramp_ns = 100'000'000;
    settings.safety.calibration_hold_ns = 50'000'000;
    settings.frames.ramp_ns = settings.period_ns;  // full stiffness from the first tick
    return settings;
}

}  // namespace

TrialRig::TrialRig(const Settings& settings, FrameSource& frames)
    : period_ns_(settings.tick.period_ns),
      arming_ns_(arming_time_ns(with_short_arming(settings.tick).safety)),
      board_({.geometry = settings.tick.geometry,
              .hand = settings.hand,
              .power_up = {60000, 1, 32768, 12345, 65535, 0, 40000, 777},
              .hand_waits = true,
              .mechanics = settings.mechanics}),
      states_(settings.session),
      tick_(with_short_arming(settings.tick), board_, frames, states_, frozen_clock) {}

void TrialRig::arm() {
    tick_.arm();
    while (now_ns_ < 3 * arming_ns_ && tick_.safety_state() != SafetyState::Running) {
        run_tick();
    }
    if (tick_.safety_state() != SafetyState::Running) {
        throw std::runtime_error("stability: the tick did not reach the running state");
    }
}

void TrialRig::run_tick() {
    tick_.run({.deadline_ns = now_ns_, .now_ns = now_ns_});
    now_ns_ += period_ns_;
}

std::string unique_session() {
    static std::atomic<unsigned> count{0};
    return "stability-" + std::to_string(getpid()) + "-" + std::to_string(count.fetch_add(1));
}

double amplitude_of(std::span<const double> values) {
    if (values.size() < 3) {
        return 0.0;
    }
    // Slope of the least-squares line over the sample index, centred: cov(x, value) / var(x).
    const double middle = 0.5 * static_cast<double>(values.size() - 1);
    const double mean = std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
    double covariance = 0.0;
    double variance = 0.0;
    for (std::size_t i = 0; i < values.size(); ++i) {
        const double x = static_cast<double>(i) - middle;
        covariance += x * (values[i] - mean);
        variance += x * x;
    }
    // Range of the residuals.
    double low = 0.0;
    double high = 0.0;
    for (std::size_t i = 0; i < values.size(); ++i) {
        const double off = values[i] - mean - covariance / variance * (static_cast<double>(i) - middle);
        low = std::min(low, off);
        high = std::max(high, off);
    }
    return high - low;
}

}  // namespace haptic::rt
