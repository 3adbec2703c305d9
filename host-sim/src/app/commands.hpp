// Subcommands of host-sim. Each function adds its options to the parser and returns the command to run after parsing.
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace haptic::sim {

/// Runs a parsed command and returns the exit status.
using Command = std::function<int()>;

[[nodiscard]] Command add_check_command(CLI::App& app);
[[nodiscard]] Command add_material_command(CLI::App& app);
[[nodiscard]] Command add_materials_command(CLI::App& app);
[[nodiscard]] Command add_mesh_command(CLI::App& app);
[[nodiscard]] Command add_model_command(CLI::App& app);
[[nodiscard]] Command add_new_scene_command(CLI::App& app);
[[nodiscard]] Command add_play_command(CLI::App& app);
[[nodiscard]] Command add_query_command(CLI::App& app);
[[nodiscard]] Command add_reproduce_command(CLI::App& app);
[[nodiscard]] Command add_run_command(CLI::App& app);
[[nodiscard]] Command add_scenes_command(CLI::App& app);
[[nodiscard]] Command add_tool_command(CLI::App& app);

}  // namespace haptic::sim
