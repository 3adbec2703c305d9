// Run report: the result of a run as JSON and as a few lines of text.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "haptic/device/device_geometry.hpp"
#include "process/period_budget.hpp"
#include "process/realtime_setup.hpp"
#include "rendering/limits.hpp"
#include "rendering/workspace_walls.hpp"
#include "tick/device_proof.hpp"
#include "tick/force_budget.hpp"
#include "tick/instruments.hpp"
#include "tick/safety.hpp"
#include "tick/tick_probes.hpp"
#include "tick/tick_syscalls.hpp"

namespace haptic::rt {

/// An interruption of the run by the loss of the device.
struct Interruption {
    double at_s = 0.0;    // since the start of the run
    double lost_s = 0.0;  // until the device was back or the run ended
    std::uint32_t faults = 0;
    device::ExchangeStatus cause = device::ExchangeStatus::Ok;
    std::string black_box;  // file
};

/// When the device was armed, and what did it: start, key, command or button.
struct Arming {
    double at_s = 0.0;  // since the start of the run
    const char* by = "start";
};

/// What supervised the loop, and with which scheduling.
struct SupervisionResult {
    bool guarded = false;    // by a process; an emulated device is not
    int guard_priority = 0;  // SCHED_FIFO; 0: ordinary scheduling
    int guard_oom_score_adj = 0;
    bool guard_locked = false;    // its memory
    std::int64_t silence_ns = 0;  // after which the guard takes the loop for frozen
    int watchdog_priority = 0;    // as guard_priority
    int stop_line_priority = -1;  // -1: no stop line
    std::string lost;             // names of the supervisors that were lost
    std::int64_t frozen_ns = 0;   // time for which the loop was silent when the guard set the motors to zero; 0: never
};

struct RunResult {
    RealtimeSetup setup;
    SupervisionResult supervision;
    ThreadUsage usage;
    SafetyState state = SafetyState::Disarmed;
    std::uint32_t faults = 0;
    std::uint8_t suspects = 0;  // bit i: string i may have caused the fault
    DeviceProofResult proof;
    std::string stop = "none";  // origin of the stop: signal, duration, line, button, supervision
    std::uint64_t records_dropped = 0;
    std::uint64_t frames_dropped = 0;  // of the recording
    double duration_s = 0.0;
    std::vector<Interruption> interruptions;
    std::vector<Arming> armings;
    std::string profile;  // of forces; empty: none
    WrenchLimits limits;  // that were in effect
    BudgetLimits budget_limits;
    ForceBudget budget{BudgetLimits{}};  // its use
    WorkspaceWalls walls;
    ProbesUse probes;
    std::string device;                  // description of the device
    device::DeviceGeometry geometry;     // its strings and their tension limits
    PeriodDemand period;                 // what its ticks ask of the period
    std::int64_t exchange_bound_ns = 0;  // upper bound of the stage `exchange`; 0 for a device that never waits

    /// True if there was no fault; a requested stop is none.
    [[nodiscard]] bool succeeded() const noexcept { return (faults & ~std::uint32_t{HAPTIC_FAULT_STOP}) == 0; }
};

/// Numbers of the strings whose bits are set.
[[nodiscard]] std::vector<int> string_numbers(std::uint8_t strings);
[[nodiscard]] inline std::string_view state_name(SafetyState state) noexcept {
    return safety_state_name(static_cast<std::uint32_t>(state));
}

/// The report as JSON; its keys are a public interface.
[[nodiscard]] nlohmann::json make_report(const RunResult& result, const Instruments& instruments);

/// The report as a few lines of text.
[[nodiscard]] std::string summary(const RunResult& result, const Instruments& instruments);

}  // namespace haptic::rt
