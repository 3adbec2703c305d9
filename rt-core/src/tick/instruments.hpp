// What the tick measures of itself.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include <haptic/device/board.hpp>
#include <haptic/histogram.hpp>
#include <haptic/realtime.hpp>
#include "device/kinematics.hpp"

namespace haptic::rt {

struct Instruments {
    // Stages, ns: both exchanges; counters to velocity; frame, local proxies and wrench; tensions; state to the ring.
    Histogram exchange;
    Histogram pose;
    Histogram proxy;
    Histogram tension;
    Histogram publish;

    Histogram wakeup;      // ns, from deadline to wake-up
    Histogram period;      // ns, between wake-ups
    Histogram compute;     // ns, the whole tick
    Histogram frame_age;   // ns, of the frame rendered, each tick that had one
    Histogram probe_edge;  // ns, each call that sets a probe's line; empty without probes

    Histogram state_age;        // ns, of the device state that the planes in use answer, each tick that had one
    Histogram motion_to_force;  // ns, TickTiming::motion_to_force_ns

    std::uint64_t ticks = 0;
    std::uint64_t overruns = 0;  // deadlines that were missed
    std::uint64_t failed_exchanges = 0;
    std::array<std::uint64_t, device::kExchangeStatuses> exchange_statuses{};  // exchanges by how they ended
    device::ExchangeStatus last_failure = device::ExchangeStatus::Ok;          // of the last exchange that failed
    std::uint64_t frames_received = 0;
    std::uint64_t frames_rejected = 0;
    std::uint64_t stale_ticks = 0;
    std::uint64_t contact_ticks = 0;
    std::uint64_t unreachable_ticks = 0;  // wrenches that the strings could not make
    double peak_force = 0.0;              // N, rendered
    double peak_torque = 0.0;             // N*m
    std::uint64_t derated_ticks = 0;      // with a warm motor
    StringArray peak_motor_load{};        // of the thermal model; 1 is a fault
    std::uint64_t passivity_ticks = 0;    // at which the passivity controller changed the wrench
    std::uint64_t stiffness_limited_ticks = 0;
    std::uint64_t probe_off_ticks = 0;  // with a probe that the kernel has refused
    double least_energy = 0.0;          // J, of the passivity observer

    void count(device::ExchangeStatus status) HAPTIC_RT {
        ++exchange_statuses[static_cast<std::size_t>(status)];
        last_failure = status == device::ExchangeStatus::Ok ? last_failure : status;
    }
};

}  // namespace haptic::rt
