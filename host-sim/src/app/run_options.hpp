// Command line of `host-sim run`, and the plan that follows from it.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "app/hand_sources.hpp"
#include "app/step_record.hpp"
#include "app/workspace_file.hpp"
#include "dds/link.hpp"
#include "haptic/sim/scene.hpp"
#include "view/live_view.hpp"

namespace CLI {
class App;
}

namespace haptic::sim {

struct RunOptions {
    std::string scene;
    std::vector<std::string> assignments;
    std::string session;
    std::optional<double> duration_s;
    std::optional<std::uint64_t> steps;
    std::string clock;  // empty: real with a view, else lockstep
    std::string input;
    std::string hand = "script";
    std::string settings = "scene";
    std::string report;
    std::string record;
    std::string snapshots;
    std::string workspace;
    std::string view_address;
    std::string dds_interface;           // of the link to rt-core on another machine; empty: it is on this one
    std::vector<std::string> dds_peers;  // addresses of the other machine
    std::uint32_t dds_domain = 0;
    double wait_s = 0.0;
    bool view = false;
    bool view_control = false;
    bool verify = false;
};

/// Adds the options of `host-sim run` to a parser. `options` must outlive it.
void add_run_options(CLI::App& app, RunOptions& options);

/// Reads a built-in scene or a scene file with these assignments, and writes its notices to standard error. Throws
/// ConfigError.
[[nodiscard]] Scene load_scene(const std::string& which, const std::vector<std::string>& assignments);
/// The same of what was opened.
[[nodiscard]] Scene load_scene(Config config, const std::string& name, const std::vector<std::string>& assignments);

/// What time passes in a run.
enum class RunClock : std::uint8_t {
    Lockstep,  // none: as fast as possible
    Real,      // CLOCK_MONOTONIC
    Device     // that of the device states
};
[[nodiscard]] std::string_view name_of(RunClock clock) noexcept;

/// Everything needed to set up a run.
struct Plan {
    /// Throws for invalid or contradictory options.
    explicit Plan(const RunOptions& options);

    Scene scene;
    RecordNotes origin;
    std::uint64_t steps = 0;  // 0: any number
    double duration_s = 0.0;  // of the scene, unless steps are given; both 0: until stopped
    RunClock clock = RunClock::Lockstep;
    HandSettings hand;
    std::optional<std::uint64_t> settings_seed;  // of live settings that change at random
    std::string session;                         // name of the rings; empty: no rings
    std::optional<LinkSettings> link;            // to rt-core on another machine
    std::shared_ptr<WorkspaceFile> workspace;    // null: the scene's
    std::optional<view::LiveViewSettings> view;
};

}  // namespace haptic::sim
