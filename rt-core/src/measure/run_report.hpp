// What a run says of itself: JSON for machines, a few lines for people.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "tick/instruments.hpp"
#include "process/realtime_setup.hpp"
#include "tick/safety.hpp"
#include "tick/tick_probes.hpp"
#include "tick/tick_syscalls.hpp"

namespace haptic::rt {

/// The device was lost, and came back or did not.
struct Interruption {
    double at_s = 0.0;    // since the run began
    double lost_s = 0.0;  // until it was back, or until the run ended
    std::uint32_t faults = 0;
    device::ExchangeStatus cause = device::ExchangeStatus::Ok;
    std::string black_box;  // file
};

struct RunResult {
    RealtimeSetup setup;
    ThreadUsage usage;
    SafetyState state = SafetyState::Disarmed;
    std::uint32_t faults = 0;
    std::uint8_t suspects = 0;  // bit i: string i may be the one that a fault slack or residual is about
    std::string stop = "none";  // who asked for it: signal, duration, line, button
    std::uint64_t records_dropped = 0;
    std::uint64_t frames_dropped = 0;  // of the recording
    double duration_s = 0.0;
    std::vector<Interruption> interruptions;
    ProbesUse probes;
    std::string device;                  // what was driven, and where
    std::int64_t exchange_bound_ns = 0;  // of the stage `exchange`; 0 for a device that makes nothing wait

    /// Nothing went wrong: a stop that was asked for is no fault.
    [[nodiscard]] bool held() const noexcept { return (faults & ~std::uint32_t{HAPTIC_FAULT_STOP}) == 0; }
};

/// Numbers of the strings whose bits are set.
[[nodiscard]] std::vector<int> string_numbers(std::uint8_t strings);
[[nodiscard]] inline std::string_view state_name(SafetyState state) noexcept {
    return safety_state_name(static_cast<std::uint32_t>(state));
}

/// The keys are those of the design's section 4, and more.
[[nodiscard]] nlohmann::json make_report(const RunResult& result, const Instruments& instruments);

/// A few lines of text.
[[nodiscard]] std::string summary(const RunResult& result, const Instruments& instruments);

}  // namespace haptic::rt
