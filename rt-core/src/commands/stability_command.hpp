// `rt-core stability`: maps the stiffnesses and delays for which a virtual wall is stable, with and without the
// passivity controller.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace haptic::rt {

struct StabilityOptions {
    std::filesystem::path out;  // output folder, created if missing
    std::optional<std::filesystem::path> config;
    std::vector<std::string> assignments;  // --set
    int rows = 12;                         // stiffnesses, 10 to 2000 N/m in equal ratios
    int columns = 11;                      // delays, 0 to 20 ms in equal steps, rounded to whole ticks
    double duration_s = 2.5;               // of each trial
    double hand_stiffness = 100.0;         // N/m
    double hand_damping = 0.0;             // N s/m
};

/// Runs all trials and writes stability.csv and stability.html, the map. Returns 0 if no vibration grew with the
/// controller, else kExitFaulted. Throws ConfigError, RingError, std::invalid_argument, and std::runtime_error for a
/// file that cannot be written.
int stability_command(const StabilityOptions& options);

}  // namespace haptic::rt
