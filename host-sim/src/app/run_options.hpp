// What host-sim run is told on its command line, and what follows from that before the run begins.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "app/hand_sources.hpp"
#include "app/step_record.hpp"
#include "app/workspace_file.hpp"
#include <haptic/sim/scene.hpp>
#include "view/live_view.hpp"

namespace CLI {  // NOLINT(readability-identifier-naming): theirs
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
    std::string report;
    std::string record;
    std::string snapshots;
    std::string workspace;
    std::string view_address;
    double wait_s = 0.0;
    bool view = false;
    bool view_control = false;
    bool verify = false;
};

/// Binds the options of host-sim run to a place that outlives the parsing.
void add_run_options(CLI::App& app, RunOptions& options);

/// What has to be known before a run can be set up.
struct Plan {
    /// Throws for whatever is wrong with the options.
    explicit Plan(const RunOptions& options);

    Scene scene;
    RecordNotes origin;
    std::uint64_t steps = 0;  // 0: until stopped
    bool real = false;
    HandSettings hand;
    std::string session;                       // of the rings; empty: none are used
    std::shared_ptr<WorkspaceFile> workspace;  // null: that of the scene
    std::optional<view::LiveViewSettings> view;
};

}  // namespace haptic::sim
