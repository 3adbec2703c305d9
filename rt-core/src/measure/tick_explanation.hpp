// Tick explanation: the stage in which a late tick lost its time, and the cause, inferred from the kernel's
// counters.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "tick/instruments.hpp"
#include "tick/tick_timing.hpp"

namespace haptic::rt {

/// Where a tick can lose time: before it runs (Wakeup), or in one of its stages.
enum class LateStage : std::uint8_t { Wakeup, Exchange, Pose, Proxy, Tension, Publish, Record };
inline constexpr std::size_t kLateStages = 1 + kTickStages;

enum class LateCause : std::uint8_t {
    Usual,      // no longer than usual
    PageFault,  // a page was not in memory
    Preempted,  // a thread of higher priority took the processor
    Queued,     // the thread was runnable but did not get its processor
    Board,      // the device answered late or not at all
    Stolen,     // the hypervisor gave the processor to another guest
    Timer,      // the timer interrupt that wakes the thread came late
    Unseen      // the thread had its processor; something that the kernel does not count took the time
};

/// Median time of each stage in this run, ns.
struct MedianTimes {
    std::array<std::int64_t, kLateStages> stages_ns{};
};
[[nodiscard]] MedianTimes median_times(const Instruments& instruments);

struct TickExplanation {
    LateStage stage = LateStage::Wakeup;  // stage with the largest excess over its median
    std::int64_t excess_ns = 0;           // that excess
    LateCause cause = LateCause::Usual;
    std::string why;  // a sentence
};

/// Time of this tick in a stage, ns.
[[nodiscard]] std::int64_t time_in(const TimedTick& tick, LateStage stage);

/// Part of a tick to explain: its wake-up, its stages, or both.
enum class Explain : std::uint8_t { Wakeup, Stages, Both };

/// Explains a tick. `stolen_ms`: time stolen by a hypervisor in the 0.1 s around the tick; -1 if unknown.
[[nodiscard]] TickExplanation explain(const TimedTick& tick, const MedianTimes& usual, std::int64_t stolen_ms,
                                      Explain what = Explain::Both);

/// Names as used in the report.
[[nodiscard]] std::string_view name_of(LateStage stage) noexcept;
[[nodiscard]] std::string_view name_of(LateCause cause) noexcept;

}  // namespace haptic::rt
