// Settings of the tick, and the settings of its parts that follow from them.
#pragma once

#include <cstdint>

#include "device/tension.hpp"
#include "device/thermal.hpp"
#include "haptic/device/device_geometry.hpp"
#include "haptic/types.hpp"
#include "rendering/limits.hpp"
#include "rendering/overlay.hpp"
#include "rendering/passivity.hpp"
#include "rendering/renderer.hpp"
#include "rendering/workspace_walls.hpp"
#include "tick/device_proof.hpp"
#include "tick/force_budget.hpp"
#include "tick/safety.hpp"

namespace haptic::rt {

/// Thermal ratings of motors for which the device geometry gives none, and when derating begins.
struct MotorSettings {
    double continuous_share = 0.5;  // 1, continuous tension as a share of the maximum
    double time_constant_s = 20.0;  // s
    double derate_from = 0.7;       // ThermalSettings::derate_from
};

struct TickSettings {
    device::DeviceGeometry geometry = device::spidar_g6_x3r();
    std::int64_t period_ns = 1'000'000;  // ns, between ticks
    int exchanges = 2;                   // per tick; with 2 the force is sent in the same tick, with 1 in the next
    double maximum_string_speed = 2.0;   // m/s; a faster string is an encoder fault
    int velocity_window_ticks = 8;       // VelocitySettings::window_ticks
    double tension_effort = 1e-5;        // 1, TensionSettings::effort
    Infeasible tension_infeasible = Infeasible::Closest;
    double tension_continuity = 1e-5;  // 1, TensionSettings::continuity
    double tension_rate = 3000.0;      // N/s, of one string; above what the rate limits of the wrench can cause
    FrameSettings frames;
    OverlaySettings overlay;
    WrenchLimits limits;
    PassivitySettings passivity;
    SafetySettings safety;
    DeviceProofSettings proof;  // only if safety.prove
    BudgetLimits budget;
    WorkspaceWalls walls;
    MotorSettings motors;
    int stop_button = -1;                                   // index of the board's switch that stops the loop; -1: none
    bool stop_when_released = false;                        // the switch opens to stop, so that a broken wire stops too
    bool commissioning = false;                             // nobody has signed for the device; a flag in every tick
    std::int64_t black_box_ns = 2 * kNanosecondsPerSecond;  // ns, duration of the black box
};

/// The settings themselves. Throws std::invalid_argument if one is out of range or two contradict each other.
[[nodiscard]] TickSettings checked(const TickSettings& settings);

/// Tension bounds of the device and the largest change of a tension in one period.
[[nodiscard]] TensionSettings tension_settings(const TickSettings& settings);

/// Thermal ratings of the device's motors; where the device file gives none, those of MotorSettings.
[[nodiscard]] ThermalSettings thermal_settings(const TickSettings& settings);

}  // namespace haptic::rt
