// `rt-core stability --scene`: maps where a grip that is held in a host-sim scene comes to rest.
#pragma once

#include <string>
#include <vector>

#include "commands/stability_command.hpp"

namespace haptic::rt {

/// Names of the files that are written for a scene.
[[nodiscard]] std::vector<std::string> result_names(const std::string& scene);

/// Runs all trials, prints the map and writes stability-SCENE.csv. Returns 0 if no oscillation grew, else
/// kExitFaulted. Throws Refusal, ConfigError, CsvError, RingError, std::invalid_argument and std::runtime_error.
int scene_stability_command(const StabilityOptions& options);

}  // namespace haptic::rt
