// `rt-core run --device replay:F.csv`: a recorded run once more, as fast as it goes, and whether it came out the same.
#pragma once

#include <haptic/config.hpp>
#include "commands/run_command.hpp"

namespace haptic::rt {

/// Exit status 0 if every tick came out as recorded, or if other settings were asked for; kExitDiffers if not.
/// Throws Refusal, ConfigError, CsvError.
int replay_command(const RunOptions& options);

/// Keeps the settings of a run beside its recording, for the replay. Throws std::runtime_error that names the file.
void write_config_beside(const std::filesystem::path& recording, const Config& config);

}  // namespace haptic::rt
