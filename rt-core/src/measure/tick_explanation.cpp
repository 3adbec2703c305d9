#include "measure/tick_explanation.hpp"

#include <algorithm>
#include <cstdio>

namespace haptic::rt {
namespace {

// An excess below this is imperceptible to a person and harmless to a device.
constexpr std::int64_t kMinExcessNs = 20'000;
// A run-queue wait below this counts as none.
constexpr std::int64_t kImmediateNs = 1000;

constexpr std::array<std::string_view, kLateStages> kStageNames = {"wake-up", "exchange", "pose",  "proxy",
                                                                   "tension", "publish",  "record"};
constexpr std::array<std::string_view, 8> kCauseNames = {"usual", "page_fault", "preempted", "queued",
                                                         "board", "stolen",     "timer",     "unseen"};

std::string microseconds_text(std::int64_t duration_ns) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), duration_ns < 10'000 ? "%.1f us" : "%.0f us",
                  static_cast<double>(duration_ns) * 1e-3);
    return text.data();
}

std::string counted(std::int64_t number, const char* what) {
    return std::to_string(number) + " " + what + (number == 1 ? "" : "s");
}

bool failed(std::int8_t status) {
    return status != kNoExchange && status != static_cast<std::int8_t>(device::ExchangeStatus::Ok);
}

std::string stolen_text(std::int64_t stolen_ms) {
    return "a hypervisor gave the processor to another guest: " + std::to_string(stolen_ms) +
           " ms were stolen in the 0.1 s around the tick";
}

/// Cause of a late wake-up. Order of evidence: the thread's own run-queue wait, then stolen time; the timer otherwise.
void explain_wakeup(const TimedTick& tick, std::int64_t stolen_ms, TickExplanation& result) {
    // The thread's own wait accounts for at least half of the excess.
    if (tick.waited_ns >= result.excess_ns / 2) {
        result.cause = LateCause::Queued;
        result.why = "the thread was runnable and waited " + microseconds_text(tick.waited_ns) +
                     " for its processor, which was used by a thread of the same or a higher priority or by a "
                     "non-preemptible part of the kernel";
    } else if (stolen_ms > 0) {
        // Second best: time that the hypervisor reports as taken.
        result.cause = LateCause::Stolen;
        result.why = stolen_text(stolen_ms);
    } else {
        // Nothing else accounts for it: the wake-up itself was late.
        result.cause = LateCause::Timer;
        result.why =
            "the timer interrupt came late: interrupts were disabled, the processor was in a deep idle state, or "
            "firmware or a hypervisor used it";
        // The wait after the wake-up, if known, tells how sure this is.
        if (tick.waited_ns < 0) {
            result.why += "; this kernel does not report how long the thread then waited for its processor";
        } else if (tick.waited_ns < kImmediateNs) {
            result.why += " (once woken, the thread got its processor at once)";
        } else {
            result.why += " (once woken, the thread waited " + microseconds_text(tick.waited_ns) + ")";
        }
    }
}

/// Cause of a long stage. Evidence is tried from the most to the least specific.
void explain_stage(const TimedTick& tick, std::int64_t stolen_ms, TickExplanation& result) {
    // A failed exchange is a cause in itself.
    const bool in_exchange = result.stage == LateStage::Exchange;
    const std::array<std::int8_t, 3> exchanges = {tick.exchange_collected, tick.exchange_in, tick.exchange_out};
    const auto* const first = std::find_if(exchanges.begin(), exchanges.end(), failed);
    if (in_exchange && first != exchanges.end()) {
        const std::int8_t status = *first;
        result.cause = LateCause::Board;
        result.why = "the exchange failed (" + std::string(describe(static_cast<device::ExchangeStatus>(status))) + ")";
    } else if (tick.usage.page_faults > 0) {
        // Memory is locked, so that any page fault is a defect.
        result.cause = LateCause::PageFault;
        result.why = counted(tick.usage.page_faults, "page fault") + " in this tick: a page was not in memory";
    } else if (tick.usage.forced_switches > 0 && (tick.waited_ns < 0 || tick.waited_ns >= result.excess_ns / 2)) {
        // Switched out against its will, for at least half of the excess if that is known.
        result.cause = LateCause::Preempted;
        result.why = "preempted " + counted(tick.usage.forced_switches, "time");
        result.why += tick.waited_ns >= 0 ? ", and without its processor for " + microseconds_text(tick.waited_ns) : "";
    } else if (in_exchange && tick.usage.voluntary_switches > 1) {
        // Every tick sleeps once, until its deadline; another sleep was in the exchange.
        result.cause = LateCause::Board;
        result.why = "the thread slept until the device answered";
    } else if (stolen_ms > 0) {
        // Stolen time is known only as a total around the tick, so it comes late in the order.
        result.cause = LateCause::Stolen;
        result.why = stolen_text(stolen_ms);
    } else {
        // None of the counters saw anything.
        result.cause = LateCause::Unseen;
        result.why =
            "the thread kept its processor and had no page fault: interrupts, firmware, a hypervisor or cold caches "
            "took the time";
    }
}

}  // namespace

MedianTimes median_times(const Instruments& m) {
    MedianTimes usual;
    usual.stages_ns = {m.wakeup.percentile_ns(0.5),
                       m.exchange.percentile_ns(0.5),
                       m.pose.percentile_ns(0.5),
                       m.proxy.percentile_ns(0.5),
                       m.tension.percentile_ns(0.5),
                       m.publish.percentile_ns(0.5),
                       0};
    return usual;
}

std::int64_t time_in(const TimedTick& tick, LateStage stage) {
    return stage == LateStage::Wakeup ? tick.wakeup_ns() : tick.timing.stages_ns[static_cast<std::size_t>(stage) - 1];
}

TickExplanation explain(const TimedTick& tick, const MedianTimes& usual, std::int64_t stolen_ms, Explain what) {
    TickExplanation result;
    // Stage with the largest excess over its median.
    result.excess_ns = -1;
    const std::size_t first = what == Explain::Stages ? 1 : 0;
    const std::size_t last = what == Explain::Wakeup ? 1 : kLateStages;
    for (std::size_t i = first; i < last; ++i) {
        const auto stage = static_cast<LateStage>(i);
        const std::int64_t excess_ns = std::max<std::int64_t>(0, time_in(tick, stage) - usual.stages_ns[i]);
        if (excess_ns > result.excess_ns) {
            result.stage = stage;
            result.excess_ns = excess_ns;
        }
    }
    // Name the cause of a perceptible excess only.
    if (result.excess_ns < kMinExcessNs) {
        result.cause = LateCause::Usual;
        result.why = "no more than " + microseconds_text(result.excess_ns) + " above the median";
    } else if (result.stage == LateStage::Wakeup) {
        explain_wakeup(tick, stolen_ms, result);
    } else {
        explain_stage(tick, stolen_ms, result);
    }
    return result;
}

std::string_view name_of(LateStage stage) noexcept {
    return kStageNames[static_cast<std::size_t>(stage)];
}

std::string_view name_of(LateCause cause) noexcept {
    return kCauseNames[static_cast<std::size_t>(cause)];
}

}  // namespace haptic::rt
