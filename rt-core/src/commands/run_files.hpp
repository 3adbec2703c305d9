// Files that a run reads and writes, with those whose names are derived from its options.
#pragma once

#include <filesystem>
#include <string>

#include "commands/run_command.hpp"
#include "haptic/config.hpp"
#include "program/file_uses.hpp"

namespace haptic::rt {

/// Files of a run or of the replay of a recording, except those of its device.
[[nodiscard]] FileUses files_of_run(const RunOptions& options);
/// Adds the device geometry and the protocol that a configuration names.
void add_device_files(FileUses& files, const Config& config);

/// Path of a black box with this extension: beside the report, the recording, or in the working directory.
[[nodiscard]] std::filesystem::path black_box_path(const RunOptions& options, const std::string& extension);

/// The recording that `--device replay:F.csv` names; empty for a device.
[[nodiscard]] std::filesystem::path replayed_recording(const RunOptions& options);

/// File that holds the settings of a recording: F.config.toml for F.csv.
[[nodiscard]] std::filesystem::path config_file_of(const std::filesystem::path& recording);

}  // namespace haptic::rt
