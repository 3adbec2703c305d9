// host-sim: simulates a scene and sends its contacts to the haptic loop.

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <utility>
#include <vector>

#include "app/commands.hpp"
#include "app/host_sim_documents.hpp"

namespace {

constexpr int kFailed = 1;  // haptic-host-sim.service does not restart after this status

int run(int argc, char** argv) {
    CLI::App app("Simulates deformable objects and sends the contacts of a haptic tool to rt-core.", "host-sim");
    app.require_subcommand(0, 1);  // with none, the check below names a wrong one
    haptic::add_generate_option(app, haptic::sim::host_sim_documents);
    std::vector<std::pair<const CLI::App*, haptic::sim::Command>> commands;
    const auto add = [&](const char* name, const char* what, haptic::sim::Command (*command)(CLI::App&)) {
        CLI::App& subcommand = *app.add_subcommand(name, what);
        commands.emplace_back(&subcommand, command(subcommand));
    };
    add("run", "Run a scene", haptic::sim::add_run_command);
    add("play", "Simulate a recording again and show it to browsers", haptic::sim::add_play_command);
    add("scenes", "List the built-in scenes", haptic::sim::add_scenes_command);
    add("mesh", "Check a mesh file and describe its contents", haptic::sim::add_mesh_command);
    add("model", "Build the particles of a body, describe them, and write them to a file",
        haptic::sim::add_model_command);
    add("tool", "Build a tool and report how well its spheres cover it", haptic::sim::add_tool_command);
    add("reproduce", "Reproduce the figures and tables of the thesis", haptic::sim::add_reproduce_command);
    add("query", "Answer single queries to the contact code", haptic::sim::add_query_command);
    try {
        app.parse(argc, argv);
        if (app.get_subcommands().empty()) {
            throw CLI::RequiredError("A subcommand");
        }
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? 0 : kFailed;
    }
    for (const auto& [subcommand, command] : commands) {
        if (subcommand->parsed()) {
            return command();
        }
    }
    return kFailed;
}

}  // namespace

int main(int argc, char** argv) try { return run(argc, argv); } catch (const std::exception& error) {
    (void)std::fprintf(stderr, "host-sim: %s\n", error.what());
    return kFailed;
}
