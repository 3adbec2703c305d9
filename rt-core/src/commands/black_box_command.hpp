// `rt-core black-box`: saves the last ticks of a run that was killed. Its guard and the next run of the session do so
// by themselves.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "process/black_box_file.hpp"

namespace haptic::rt {

/// Writes the ticks as a CSV file where they belong or, if that is not possible, in the folder for temporary files, and
/// removes the black box. Returns the CSV file; empty if there was no tick. Throws std::runtime_error.
std::optional<std::filesystem::path> save_black_box(LeftBlackBox left);

/// Saves what a killed run of this session has left, and logs where; a problem is logged too. Called before a run.
void save_left_black_box(const std::string& session);

struct BlackBoxOptions {
    std::string session = "default";
    std::optional<std::filesystem::path> out;  // other file than the one that belongs to the run
};
/// Returns the exit status. Throws std::runtime_error.
[[nodiscard]] int black_box_command(const BlackBoxOptions& options);

}  // namespace haptic::rt
