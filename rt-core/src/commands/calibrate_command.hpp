// `rt-core calibrate`: a person moves the grip, and the file of the frame says afterwards what the frame really is.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "device/geometry_fit.hpp"
#include "commands/run_command.hpp"

namespace haptic::rt {

struct CalibrateOptions {
    RunOptions run;                            // device, configuration, hand; session and recording are chosen here
    std::optional<std::string> variant;        // name or file; that of the configuration otherwise
    std::optional<std::filesystem::path> fit;  // a recording that there is already
    std::optional<std::filesystem::path> out;
    std::vector<std::string> weights;  // "STRING=KILOGRAMS@DIGIT"
    double hold_s = 1.0;               // s, for which the grip is held still after it was calibrated
    double wiggle_s = 30.0;            // s, in which it is moved
    bool yes = false;                  // ask nothing
    FitSettings fit_settings;
};

/// Exit status 0 if a geometry was found, and written where it was to be. Throws Refusal, ConfigError, CsvError.
int calibrate_command(const CalibrateOptions& options);

}  // namespace haptic::rt
