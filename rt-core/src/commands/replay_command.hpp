// `rt-core run --device replay:F.csv`: replays a recorded run as fast as possible and compares the results.
#pragma once

#include "commands/run_command.hpp"
#include "haptic/config.hpp"

namespace haptic::rt {

/// Returns 0 if every tick matches the recording or if other settings were requested, else kExitDiffers. Throws
/// Refusal, ConfigError, CsvError.
int replay_command(const RunOptions& options);

/// Saves the settings of a run next to its recording, for the replay. Throws std::runtime_error that names the file.
void save_config_for(const std::filesystem::path& recording, const Config& config);

}  // namespace haptic::rt
