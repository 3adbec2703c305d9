// `rt-core calibrate`: finds the real geometry of a device from a recording in which a person moves the grip, and
// writes its file.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "commands/run_command.hpp"
#include "device/geometry_fit.hpp"

namespace haptic::rt {

struct CalibrateOptions {
    RunOptions run;                            // device, configuration, hand; the command sets session and recording
    std::optional<std::string> geometry;       // nominal geometry, name or file; default: that of the configuration
    std::optional<std::filesystem::path> fit;  // existing recording to fit, instead of running the loop
    std::optional<std::filesystem::path> out;
    std::vector<std::string> weights;  // "STRING=KILOGRAMS@CODE"
    double hold_s = 1.0;               // s, duration for which the grip is held still after its calibration
    double wiggle_s = 30.0;            // s, duration for which it is moved
    bool yes = false;                  // no questions
    FitSettings fit_settings;
};

/// Returns 0 if a geometry was found and, unless declined, written. Throws Refusal, ConfigError, CsvError.
int calibrate_command(const CalibrateOptions& options);

}  // namespace haptic::rt
