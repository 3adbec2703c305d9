// Instruments: histograms and counters of the tick.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "device/kinematics.hpp"
#include "haptic/device/board.hpp"
#include "haptic/histogram.hpp"
#include "haptic/period_histogram.hpp"
#include "haptic/realtime.hpp"
#include "haptic/types.hpp"
#include "tick/safety.hpp"

namespace haptic::rt {

/// A rendered wrench, and where it was rendered.
struct WrenchAtPose {
    Wrench wrench;
    Pose pose;  // device_from_grip
};

struct Instruments {
    /// ns, the loop's period.
    explicit Instruments(std::int64_t period_ns = 1'000'000) noexcept : period(period_ns) {}

    // Timing stages, ns: both exchanges; counters to velocity; frame, local proxies and wrench; tensions; state to the
    // ring.
    Histogram exchange;
    Histogram pose;
    Histogram proxy;
    Histogram tension;
    Histogram publish;

    Histogram wakeup;        // ns, from deadline to wake-up
    PeriodHistogram period;  // ns, between wake-ups
    Histogram compute;       // ns, the whole tick
    Histogram frame_age;     // ns, of the rendered frame, every tick that had one
    Histogram probe_edge;    // ns, every call that sets a probe's line; empty without probes

    Histogram
        state_age;  // ns, age of the device state that the planes in use were computed from, every tick that had one
    Histogram motion_to_force;  // ns, TickTiming::motion_to_force_ns

    std::uint64_t ticks = 0;
    std::uint64_t overruns = 0;  // missed deadlines
    std::uint64_t failed_exchanges = 0;
    std::array<std::uint64_t, device::kExchangeStatuses> exchange_statuses{};  // exchanges by their status
    device::ExchangeStatus last_failure = device::ExchangeStatus::Ok;          // of the last exchange that failed
    RecentShares worst;                 // largest shares of recent time while armed
    std::int64_t max_latch_gap_ns = 0;  // ns, longest time between two latches of the encoders while armed
    std::uint64_t unproven_ticks = 0;   // in which the wrench was limited because the pose was not proved
    std::uint64_t frames_received = 0;
    std::uint64_t frames_rejected = 0;
    std::uint64_t overlays_received = 0;
    std::uint64_t overlays_refused = 0;
    std::uint64_t overlay_ticks = 0;  // in which an overlay pushed
    std::uint64_t stale_ticks = 0;
    std::uint64_t contact_ticks = 0;
    std::uint64_t unreachable_ticks = 0;  // ticks with a wrench that the strings cannot make
    std::uint64_t force_limited_ticks = 0;
    std::uint64_t slew_limited_ticks = 0;
    double peak_force = 0.0;   // N, rendered
    double peak_torque = 0.0;  // N*m
    WrenchAtPose at_peak_force;
    WrenchAtPose at_peak_torque;
    std::uint64_t derated_ticks = 0;     // with a derated motor
    std::uint64_t edge_ticks = 0;        // outside the workspace's region
    std::uint64_t budget_low_ticks = 0;  // with most of the budget used
    StringArray peak_motor_load{};       // of the thermal model; 1 is a fault
    std::uint64_t passivity_ticks = 0;   // in which the passivity controller changed the wrench
    std::uint64_t stiffness_limited_ticks = 0;
    std::uint64_t commissioning_ticks = 0;  // in the mode for a device without a signed protocol
    std::uint64_t probe_off_ticks = 0;      // with a probe switched off after an error of the kernel
    double min_energy = 0.0;                // J, of the passivity observer

    void count(device::ExchangeStatus status) HAPTIC_RT {
        ++exchange_statuses[static_cast<std::size_t>(status)];
        last_failure = status == device::ExchangeStatus::Ok ? last_failure : status;
    }
    /// Counts an exchange with this status that was counted as Ok before its answer was known.
    void recount(device::ExchangeStatus status) HAPTIC_RT {
        std::uint64_t& ok = exchange_statuses[static_cast<std::size_t>(device::ExchangeStatus::Ok)];
        ok -= ok > 0 ? 1u : 0u;  // 0: it was counted before these instruments were cleared
        count(status);
    }
};

}  // namespace haptic::rt
