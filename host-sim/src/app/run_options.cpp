#include "app/run_options.hpp"

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <stdexcept>
#include <string_view>
#include <utility>

namespace haptic::sim {
namespace {

/// Finds out before a long run, not after it, that a result could not be written.
void require_folder_of(const std::string& file) {
    const std::filesystem::path folder = std::filesystem::path(file).parent_path();
    if (!folder.empty() && !std::filesystem::is_directory(folder)) {
        throw std::runtime_error(file + ": the folder " + folder.string() + " does not exist");
    }
}

/// The seed in "hostile:SEED", 1 in "hostile", none in "script". Throws for anything else.
std::optional<std::uint64_t> hostile_seed_of(const std::string& hand) {
    constexpr std::string_view hostile = "hostile";
    if (hand == "script") {
        return std::nullopt;
    }
    if (hand == hostile) {
        return 1;
    }
    const std::string_view text(hand);
    std::uint64_t seed = 0;
    if (text.starts_with(hostile) && text.size() > hostile.size() + 1 && text[hostile.size()] == ':') {
        const auto [end, error] = std::from_chars(text.data() + hostile.size() + 1, text.data() + text.size(), seed);
        if (error == std::errc() && end == text.data() + text.size()) {
            return seed;
        }
    }
    throw std::runtime_error("--hand " + hand + ": must be script, hostile, or hostile:SEED with a whole number SEED");
}

}  // namespace

Plan::Plan(const RunOptions& options) {
    require_folder_of(options.report);
    require_folder_of(options.record);
    Config config = open_scene(options.scene);
    for (const std::string& assignment : options.assignments) {
        config.set(assignment);
    }
    const std::filesystem::path path(options.scene);
    scene = read_scene(config, path.extension() == ".toml" ? path.stem().string() : options.scene);
    origin = {.scene = options.scene, .assignments = options.assignments, .first_step = 0, .changes = {}};
    if (!options.workspace.empty()) {
        workspace = std::make_shared<WorkspaceFile>(options.workspace, scene.workspace);
        scene.workspace = workspace->settings();
        for (std::string& assignment : assignments_of(scene.workspace)) {
            origin.assignments.push_back(std::move(assignment));
        }
    }
    if (options.view_control && !options.view) {
        throw std::runtime_error("--view-control: lets viewers change the run, and there are none without --view");
    }
    const double duration_s = options.duration_s.value_or(options.view ? 0.0 : scene.duration_s);
    steps = options.steps.value_or(static_cast<std::uint64_t>(std::llround(duration_s / scene.solver.step)));
    real = options.clock.empty() ? options.view : options.clock == "real";
    hand = {.input = options.input, .hostile_seed = hostile_seed_of(options.hand), .scripted = !real || options.view};
    if (hand.hostile_seed && (real || !options.input.empty())) {
        throw std::runtime_error("--hand hostile: goes with --clock lockstep and without --input");
    }
    session = real && options.session.empty() ? "default" : options.session;
    if (options.view) {
        view = view::parse_view_address(options.view_address);
        view->control = options.view_control;
        view->session = session;
    }
}

void add_run_options(CLI::App& app, RunOptions& options) {
    app.add_option("scene", options.scene, "A built-in scene (host-sim scenes) or a scene file, NAME.toml")->required();
    app.add_option("--set", options.assignments, "Override a key of the scene, e.g. solver.iterations=5; repeatable")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    app.add_option("--session", options.session,
                   "Name of the rings that join this process to rt-core; with --clock lockstep, frames are published "
                   "only if it is given [default]");
    auto* duration = app.add_option("--duration", options.duration_s,
                                    "Simulated seconds; 0 runs until stopped [the scene's; with --view 0]")
                         ->check(CLI::Range(0.0, 1e6));
    app.add_option("--steps", options.steps, "Number of steps; 0 runs until stopped")->excludes(duration);
    app.add_option("--clock", options.clock,
                   "real: paced, the hand is the device of rt-core; lockstep: as fast as can be, the hand is the "
                   "scene's script or --input [lockstep; with --view real]")
        ->check(CLI::IsMember({"real", "lockstep"}));
    app.add_option("--input", options.input,
                   "Follow a recorded hand: time_s, x_m, y_m, z_m, ... in the device frame; curl and buttons, if "
                   "there are such columns, close it and press them");
    app.add_option("--hand", options.hand,
                   "With --clock lockstep: script, the scene's own; hostile or hostile:SEED, one that darts at the "
                   "surfaces at up to 5 m/s, to be used with --verify")
        ->capture_default_str();
    app.add_option(
        "--workspace", options.workspace,
        "A file with a table [workspace] in place of the scene's; with --clock real it is taken anew, without "
        "a jump of the force, whenever it changes");
    app.add_option("--wait", options.wait_s,
                   "With --clock real: seconds to hold the scene back at most, until rt-core is running")
        ->check(CLI::Range(0.0, 3600.0));
    app.add_option("--report", options.report, "Write a JSON report at the end");
    app.add_option("--record", options.record, "Write a CSV record of every step at the end");
    app.add_option("--snapshots", options.snapshots, "Write POV-Ray scenes of the moments round the contact there");
    app.add_option_function<std::string>(
           "--view",
           [&options](const std::string& address) {
               options.view = true;
               options.view_address = address;
           },
           "Show the scene to browsers, at this address of this machine; without one, to this machine alone "
           "[127.0.0.1:7060]")
        ->type_name("[ADDR:PORT]")
        ->expected(0, 1)
        ->trigger_on_parse();
    app.add_flag(
        "--view-control", options.view_control,
        "With --view: viewers may change the run: pause, reset, other scenes, parameters, record, and the hand "
        "with the mouse as long as no device has it");
    app.add_flag("--verify", options.verify,
                 "Check every step independently for a proxy that passed through a surface; exit status 1 if one did");
}

}  // namespace haptic::sim
