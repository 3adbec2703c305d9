// host-sim: simulates a scene and sends its contacts to the haptic loop.

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <iostream>
#include <string>
#include <utility>
#include <vector>

#include "app/commands.hpp"
#include "app/host_sim_documents.hpp"
#include "program/run_program.hpp"

namespace {

/// The arguments; if there are none, and a person at a terminal accepts, those that show a scene in a browser.
std::vector<const char*> arguments_or_offer(int argc, char** argv) {
    if (argc != 1 || isatty(STDIN_FILENO) == 0 || isatty(STDOUT_FILENO) == 0) {
        return {argv, argv + argc};
    }
    std::fputs(
        "Show a scene in a browser, with the mouse as the hand?\n"
        "    host-sim run fish-grab --view --view-control\n"
        "[Y/n] ",
        stdout);
    std::fflush(stdout);
    std::string answer;
    const bool accepted = std::getline(std::cin, answer) && (answer.empty() || answer == "y" || answer == "Y");
    return accepted ? std::vector<const char*>{argv[0], "run", "fish-grab", "--view", "--view-control"}
                    : std::vector<const char*>{argv, argv + argc};
}

int program(int argc, char** argv) {
    CLI::App app("Simulates deformable objects and sends the contacts of a haptic tool to rt-core.", "host-sim");
    haptic::add_generate_option(app, haptic::sim::host_sim_documents);
    std::vector<std::pair<const CLI::App*, haptic::sim::Command>> commands;
    const auto add = [&](const char* name, const char* what, haptic::sim::Command (*command)(CLI::App&)) {
        CLI::App& subcommand = *app.add_subcommand(name, what);
        commands.emplace_back(&subcommand, command(subcommand));
    };
    add("run", "Run a scene", haptic::sim::add_run_command);
    add("play", "Simulate a recording again and show it to browsers", haptic::sim::add_play_command);
    add("scenes", "List the built-in scenes", haptic::sim::add_scenes_command);
    add("check", "Check a scene without running it, and describe it", haptic::sim::add_check_command);
    add("new-scene", "Write a scene in which a hand presses a mesh of yours", haptic::sim::add_new_scene_command);
    add("mesh", "Check a mesh file and describe its contents", haptic::sim::add_mesh_command);
    add("model", "Build the particles of a body, describe them, and write them to a file",
        haptic::sim::add_model_command);
    add("tool", "Build a tool and report how well its spheres cover it", haptic::sim::add_tool_command);
    add("materials", "List the named materials", haptic::sim::add_materials_command);
    add("material", "Test a material, or the bodies of a scene, virtually against what was asked for",
        haptic::sim::add_material_command);
    add("reproduce", "Reproduce the figures and tables of the thesis", haptic::sim::add_reproduce_command);
    add("query", "Answer single queries to the contact code", haptic::sim::add_query_command);
    app.require_subcommand(0, 1);
    const std::vector<const char*> arguments = arguments_or_offer(argc, argv);
    return haptic::run_program(app, static_cast<int>(arguments.size()), arguments.data(), [&commands] {
        const auto given =
            std::find_if(commands.begin(), commands.end(), [](const auto& c) { return c.first->parsed(); });
        return given->second();
    });
}

}  // namespace

int main(int argc, char** argv) {
    return haptic::run_main(program, argc, argv);
}
