// Why a tick was late: which stage took the time, and what the kernel lets one see of the cause.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "tick/instruments.hpp"
#include "tick/tick_timing.hpp"

namespace haptic::rt {

/// Where a tick can lose time: before it runs, or in one of its stages.
enum class LateStage : std::uint8_t { Wakeup, Exchange, Pose, Proxy, Tension, Publish, Record };
inline constexpr std::size_t kLateStages = 1 + kTickStages;

enum class LateCause : std::uint8_t {
    Usual,      // it took no longer than usual
    PageFault,  // memory had to be fetched
    Preempted,  // something of higher priority took the processor away
    Queued,     // the thread was ready and the processor was not given to it
    Board,      // the device took that long to answer, or did not
    Stolen,     // a hypervisor gave the processor to another machine
    Timer,      // the interrupt that wakes the thread came late
    Unseen      // the thread had its processor, and something that the kernel does not count took the time
};

/// What is usual in this run, ns: the medians.
struct UsualTimes {
    std::array<std::int64_t, kLateStages> stages_ns{};
};
[[nodiscard]] UsualTimes usual_times(const Instruments& instruments);

struct TickExplanation {
    LateStage stage = LateStage::Wakeup;  // that lost the most against what is usual
    std::int64_t excess_ns = 0;           // by which it did
    LateCause cause = LateCause::Usual;
    std::string why;  // a sentence
};

/// Time that this tick spent in a stage, ns.
[[nodiscard]] std::int64_t time_in(const TimedTick& tick, LateStage stage);

/// What of a tick is explained: its wake-up, its stages, or both.
enum class Explain : std::uint8_t { Wakeup, Stages, Both };

/// `stolen_ms`: that a hypervisor took in the tenth of a second around the tick; -1 if the kernel does not tell.
[[nodiscard]] TickExplanation explain(const TimedTick& tick, const UsualTimes& usual, std::int64_t stolen_ms,
                                      Explain what = Explain::Both);

/// As the report has them.
[[nodiscard]] std::string_view name_of(LateStage stage) noexcept;
[[nodiscard]] std::string_view name_of(LateCause cause) noexcept;

}  // namespace haptic::rt
