// `rt-core bringup`: the guided first day of a device. Writes a protocol and a geometry file, and lets a person sign.
#pragma once

#include <filesystem>

#include "commands/bringup_steps.hpp"
#include "commands/run_command.hpp"

namespace haptic::rt {

struct BringupOptions {
    RunOptions run;                       // device, configuration, hand, wiring
    std::optional<std::string> geometry;  // nominal geometry, name or file; default: that of the configuration
    std::filesystem::path out;            // geometry file; the protocol lies beside it
    BringupStepSettings steps;
    double dead_man_s = 0.3;  // time-out of the dead-man key
    int button = -1;          // switch of the board that replaces the key
    bool sign = false;        // measure nothing: sign for the present geometry file after a calibration
    bool resume = false;      // continue an unfinished protocol without asking
};

/// Returns 0 if the protocol was finished, signed or declined, or the person stopped; kExitFailed if the device is not
/// fit to be signed for; kExitFaulted if the board was lost. Throws Refusal, ConfigError.
int bringup_command(const BringupOptions& options);

}  // namespace haptic::rt
