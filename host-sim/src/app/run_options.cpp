#include "app/run_options.hpp"

#include <CLI/CLI.hpp>
#include <charconv>
#include <filesystem>
#include <iostream>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "dds/relay.hpp"
#include "program/file_uses.hpp"
#include "program/option_checks.hpp"

namespace haptic::sim {
namespace {

constexpr std::uint64_t kMaxSteps = 1'000'000'000'000;  // three centuries at 100 steps per second

/// Of an option that is `own`, `seeded` or `seeded`:SEED: SEED, 1 for `seeded`, nullopt for `own`. Throws for any other
/// text.
std::optional<std::uint64_t> seed_of(const std::string& option, std::string_view text, std::string_view own,
                                     const std::string& seeded) {
    if (text == own) {
        return std::nullopt;
    }
    if (text == seeded) {
        return 1;
    }
    std::uint64_t seed = 0;
    if (text.starts_with(seeded + ":") && text.size() > seeded.size() + 1) {
        const auto [end, error] = std::from_chars(text.data() + seeded.size() + 1, text.data() + text.size(), seed);
        if (error == std::errc() && end == text.data() + text.size()) {
            return seed;
        }
    }
    throw std::runtime_error(option + " " + std::string(text) + ": must be " + std::string(own) + ", " + seeded +
                             ", or " + seeded + ":SEED with an integer SEED");
}

/// The clock of the options. Throws for options that need another one.
RunClock clock_of(const RunOptions& options) {
    if (options.clock == "device") {
        if (options.view || !options.input.empty()) {
            throw std::runtime_error("--clock device excludes --view and --input");
        }
        return RunClock::Device;
    }
    const bool real = options.clock.empty() ? options.view : options.clock == "real";
    return real ? RunClock::Real : RunClock::Lockstep;
}

/// Files of a run. A scene that is no file is built in.
FileUses files_of_plan(const RunOptions& options) {
    FileUses files;
    if (std::filesystem::exists(options.scene)) {
        files.reads("the scene ", options.scene);
    }
    files.reads("--input ", options.input);
    files.writes("--record ", options.record);
    files.writes("--report ", options.report);
    files.writes("--snapshots ", options.snapshots);
    return files;
}

}  // namespace

std::string_view name_of(RunClock clock) noexcept {
    switch (clock) {
        case RunClock::Lockstep:
            return "lockstep";
        case RunClock::Real:
            return "real";
        case RunClock::Device:
            return "device";
    }
    return "unknown";
}

Scene load_scene(const std::string& which, const std::vector<std::string>& assignments) {
    return load_scene(open_scene(which), scene_name(which), assignments);
}

Scene load_scene(Config config, const std::string& name, const std::vector<std::string>& assignments) {
    for (const std::string& assignment : assignments) {
        config.set(assignment);
    }
    Scene scene = read_scene(config, name);
    for (const std::string& notice : scene.notices) {
        std::cerr << notice << '\n';
    }
    return scene;
}

Plan::Plan(const RunOptions& options) {
    files_of_plan(options).require_distinct();
    scene = load_scene(options.scene, options.assignments);
    origin = {.scene = options.scene, .assignments = options.assignments, .first_step = 0, .changes = {}};
    if (!options.workspace.empty()) {
        workspace = std::make_shared<WorkspaceFile>(options.workspace, scene.workspace);
        scene.workspace = workspace->settings();
        for (std::string& assignment : assignments_of(scene.workspace)) {
            origin.assignments.push_back(std::move(assignment));
        }
    }
    if (options.view_control && !options.view) {
        throw std::runtime_error("--view-control requires --view");
    }
    steps = options.steps.value_or(0);
    duration_s = options.steps ? 0.0 : options.duration_s.value_or(options.view ? 0.0 : scene.duration_s);
    clock = clock_of(options);
    const bool lockstep = clock == RunClock::Lockstep;
    hand = {.input = options.input,
            .hostile_seed = seed_of("--hand", options.hand, "script", "hostile"),
            .scripted = lockstep || options.view};
    if (hand.hostile_seed && (!lockstep || !options.input.empty())) {
        throw std::runtime_error("--hand hostile requires --clock lockstep and excludes --input");
    }
    settings_seed = seed_of("--settings", options.settings, "scene", "random");
    if (settings_seed && !lockstep) {
        throw std::runtime_error("--settings random requires --clock lockstep");
    }
    session = !lockstep && options.session.empty() ? "default" : options.session;
    if (!options.dds_interface.empty()) {
        if (clock != RunClock::Real) {
            throw std::runtime_error("--dds requires --clock real");
        }
        link = LinkSettings{.session = session,
                            .interface = options.dds_interface,
                            .peers = options.dds_peers,
                            .domain = options.dds_domain};
        session = SimulationRelay::ring_session(*link);
    } else if (!options.dds_peers.empty()) {
        throw std::runtime_error("--dds-peer requires --dds");
    }
    if (options.view) {
        view = view::parse_view_address(options.view_address);
        view->control = options.view_control;
        view->session = session;
    }
}

void add_run_options(CLI::App& app, RunOptions& options) {
    app.add_option("scene", options.scene, "Built-in scene (list: host-sim scenes) or scene file NAME.toml")
        ->required();
    app.add_option("--set", options.assignments, "Override a scene key, e.g. solver.iterations=5; repeatable")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    app.add_option(
        "--session", options.session,
        "Name of the rings shared with rt-core; with --clock lockstep, frames are published only if it is given "
        "[default]");
    auto* duration = app.add_option("--duration", options.duration_s,
                                    "Simulated seconds; 0: until stopped [the scene's; 0 with --view]")
                         ->check(number_in(0.0, 1e6));
    app.add_option("--steps", options.steps, "Number of steps; 0: until stopped")
        ->check(whole_number_to(kMaxSteps))
        ->excludes(duration);
    app.add_option("--clock", options.clock,
                   "real: in real time, the hand is rt-core's device; device: the same in the time of the device's "
                   "states, one step as soon as they have advanced by one, for rt-core stability; lockstep: as fast as "
                   "possible, the hand is the scene's script or --input [lockstep; real with --view]")
        ->check(CLI::IsMember({"real", "device", "lockstep"}));
    app.add_option(
        "--input", options.input,
        "Follow a recorded hand: CSV with time_s, x_m, y_m, z_m, ... in the device frame, and optionally curl and "
        "buttons");
    app.add_option(
           "--hand", options.hand,
           "With --clock lockstep: script (the scene's), or hostile or hostile:SEED, a random hand that darts at the "
           "surfaces at up to 5 m/s, for use with --verify")
        ->capture_default_str();
    app.add_option("--settings", options.settings,
                   "With --clock lockstep: scene (the scene's), or random or random:SEED, live settings that change at "
                   "random within the ranges of the live view's controls, but those that --set gives, for use with "
                   "--verify")
        ->capture_default_str();
    app.add_option("--workspace", options.workspace,
                   "File with a table [workspace] that replaces the scene's; with --clock real it is reloaded whenever "
                   "it changes, "
                   "without a jump of the force");
    app.add_option(
           "--wait", options.wait_s,
           "With --clock real: wait for rt-core to run before the scene starts, and give up after this many seconds")
        ->check(number_in(0.0, 3600.0));
    app.add_option_function<std::string>(
           "--dds",
           [&options](const std::string& interface) { options.dds_interface = interface.empty() ? "lo" : interface; },
           "With --clock real: rt-core is on another machine, where rt-core relay runs; the network interface to it "
           "[lo]")
        ->type_name("[INTERFACE]")
        ->expected(0, 1)
        ->trigger_on_parse();
    app.add_option("--dds-peer", options.dds_peers,
                   "With --dds: address of rt-core's machine, on a network without multicast; repeatable")
        ->type_name("ADDRESS")
        ->allow_extra_args(false);
    app.add_option("--dds-domain", options.dds_domain, "With --dds: DDS domain")
        ->check(CLI::Range(0, 232))
        ->capture_default_str();
    app.add_option("--report", options.report, "Write a JSON report at the end")->check(result_file());
    app.add_option("--record", options.record, "Write a CSV record of every step while the run goes on")
        ->check(result_file());
    app.add_option("--snapshots", options.snapshots,
                   "Folder for POV-Ray scenes of the moments around the first contact and of the largest force")
        ->check(result_folder());
    app.add_option_function<std::string>(
           "--view",
           [&options](const std::string& address) {
               options.view = true;
               options.view_address = address;
           },
           "Serve a live view to browsers at this address of this machine; without ADDR:PORT, to this machine only "
           "[127.0.0.1:7060]")
        ->type_name("[ADDR:PORT]")
        ->expected(0, 1)
        ->trigger_on_parse();
    app.add_flag("--view-control", options.view_control,
                 "With --view: viewers may pause and reset, change scene and parameters, record, and move the hand "
                 "with the mouse "
                 "unless a device holds it");
    app.add_flag(
        "--verify", options.verify,
        "Check in every step, by an independent method, that no proxy passed through a surface, no sheet through a "
        "sheet and nothing that moves into the ground (exit status 1 if something did), and count where other surfaces "
        "pass through themselves or one another");
}

}  // namespace haptic::sim
