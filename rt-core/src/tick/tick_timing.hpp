// Timing of one tick by stages, and the tick as a measurement keeps it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "tick/tick_record.hpp"
#include "tick/tick_syscalls.hpp"

namespace haptic::rt {

/// Stages of a tick, as in Instruments; Record is the rest until its end.
enum class TickStage : std::uint8_t { Exchange, Pose, Proxy, Tension, Publish, Record };
inline constexpr std::size_t kTickStages = 6;

/// Durations by the tick's stage clock.
struct TickTiming {
    std::array<std::int64_t, kTickStages> stages_ns{};
    /// ns, from the beginning of the exchange that latched the encoders to the end of the exchange that sent the
    /// resulting force; -1 if no exchange of this tick sent one.
    std::int64_t motion_to_force_ns = -1;
    /// ns, age of the device state that the planes in use were computed from; -1 if none are in use.
    std::int64_t state_age_ns = -1;

    [[nodiscard]] std::int64_t& of(TickStage stage) HAPTIC_RT { return stages_ns[static_cast<std::size_t>(stage)]; }
    [[nodiscard]] std::int64_t of(TickStage stage) const HAPTIC_RT {
        return stages_ns[static_cast<std::size_t>(stage)];
    }
};

/// A tick, and the kernel's counters of its thread from the end of the tick before to the end of this one.
struct TimedTick {
    std::uint64_t number = 0;  // TickRecord::number; 0: no such tick
    std::int64_t deadline_ns = 0;
    std::int64_t now_ns = 0;  // wake-up
    std::int64_t period_ns = 0;
    std::int64_t compute_ns = 0;
    std::int64_t missed = 0;  // deadlines that passed before its end
    TickTiming timing;
    ThreadUsage usage;
    std::int64_t waited_ns = -1;  // runnable without a processor; -1: not provided by the kernel
    std::uint32_t safety_state = 0;
    std::int8_t exchange_in = kNoExchange;
    std::int8_t exchange_out = kNoExchange;
    std::int8_t exchange_collected = kNoExchange;  // of the tick before

    [[nodiscard]] std::int64_t wakeup_ns() const HAPTIC_RT { return now_ns - deadline_ns; }
    /// ns, from the deadline to the end of the tick.
    [[nodiscard]] std::int64_t lateness_ns() const HAPTIC_RT { return wakeup_ns() + compute_ns; }
};

}  // namespace haptic::rt
