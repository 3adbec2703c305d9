// Where the time of one tick went: what a measurement keeps of the ticks that matter.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "tick/tick_record.hpp"
#include "tick/tick_syscalls.hpp"

namespace haptic::rt {

/// What a tick spends its time on, by the stages of Instruments; Record is what is left until its end.
enum class TickStage : std::uint8_t { Exchange, Pose, Proxy, Tension, Publish, Record };
inline constexpr std::size_t kTickStages = 6;

/// By the tick's stage clock.
struct TickTiming {
    std::array<std::int64_t, kTickStages> stages_ns{};
    /// From the beginning of the exchange that latched the encoders to the end of the one that took the motors the
    /// force of that motion; -1 where this tick's exchange took none.
    std::int64_t motion_to_force_ns = -1;
    /// How old the device state is that the planes in use answer, at the time of the tick; -1 where none are in use.
    std::int64_t state_age_ns = -1;

    [[nodiscard]] std::int64_t& of(TickStage stage) HAPTIC_RT { return stages_ns[static_cast<std::size_t>(stage)]; }
    [[nodiscard]] std::int64_t of(TickStage stage) const HAPTIC_RT {
        return stages_ns[static_cast<std::size_t>(stage)];
    }
};

/// A tick and what the kernel counted of its thread from the end of the tick before to the end of this one.
struct TimedTick {
    std::uint64_t number = 0;  // TickRecord::number; 0: there was no such tick
    std::int64_t deadline_ns = 0;
    std::int64_t now_ns = 0;  // wake-up
    std::int64_t period_ns = 0;
    std::int64_t compute_ns = 0;
    std::int64_t missed = 0;  // deadlines that had passed by its end
    TickTiming timing;
    ThreadUsage usage;
    std::int64_t waited_ns = -1;  // ready, but without a processor; -1: the kernel does not tell
    std::uint32_t safety_state = 0;
    std::int8_t exchange_in = kNoExchange;
    std::int8_t exchange_out = kNoExchange;

    [[nodiscard]] std::int64_t wakeup_ns() const HAPTIC_RT { return now_ns - deadline_ns; }
    /// From the deadline to the tick's end.
    [[nodiscard]] std::int64_t lateness_ns() const HAPTIC_RT { return wakeup_ns() + compute_ns; }
};

}  // namespace haptic::rt
