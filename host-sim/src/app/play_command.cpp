// host-sim play: simulates a recording again and shows it to viewers with a time line.

#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "app/commands.hpp"
#include "app/playback.hpp"
#include "app/recorded_run.hpp"
#include "app/replay.hpp"
#include "app/run_options.hpp"
#include "app/stop_signal.hpp"
#include "haptic/clock.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/types.hpp"
#include "program/log.hpp"
#include "view/live_view.hpp"

namespace haptic::sim {
namespace {

// 60 Hz.
constexpr std::int64_t kFramePeriodNs = 16'666'667;

struct PlayOptions {
    std::string record;
    std::string scene;
    std::vector<std::string> assignments;
    std::string view_address;
    bool watch_only = false;
};

/// Scene and settings to play: the record's own, or those of the command line.
struct PlayedScene {
    std::string which;
    std::vector<std::string> assignments;
    std::uint64_t first_step = 0;
    bool as_recorded = false;
};

PlayedScene find_scene(const PlayOptions& options, const std::optional<RecordNotes>& notes) {
    if (!options.scene.empty()) {
        return {.which = options.scene, .assignments = options.assignments};
    }
    if (!notes) {
        throw std::runtime_error(options.record +
                                 ": names no scene; give one in which to follow its hand with --scene NAME");
    }
    PlayedScene own{notes->scene, notes->assignments, notes->first_step, true};
    own.assignments.insert(own.assignments.end(), options.assignments.begin(), options.assignments.end());
    return own;
}

int play(const PlayOptions& options, bool viewed) {
    if (!viewed) {
        throw std::runtime_error(
            "play shows a recording to browsers: add --view or --view ADDR:PORT. To repeat a recording without "
            "viewers, "
            "for a report or with --verify, use host-sim run SCENE --input " +
            options.record);
    }
    const RecordedRun record = RecordedRun::load(options.record);
    const PlayedScene scene = find_scene(options, record.notes());
    Replay replay(load_scene(scene.which, scene.assignments), record, scene.as_recorded, monotonic_now_ns);
    if (scene.first_step > 0) {
        spdlog::warn(
            "the record begins at step {} of its scene but does not contain the state at that step; playing it from "
            "the "
            "scene's start",
            scene.first_step);
    }
    view::LiveViewSettings settings = view::parse_view_address(options.view_address);
    settings.control = !options.watch_only;
    warn_unless_empty(view::exposure_of(settings));
    const StopOnSignal stop;
    const std::unique_ptr<view::LiveView> view = view::open_live_view(settings);
    spdlog::info("{}: {} s of {}; the live view is at {}", options.record, record.length(),
                 replay.simulation().scene().name, view->url());
    Playback playback(replay, record, *view);
    for (std::int64_t last_ns = monotonic_now_ns(); !stop_requested();) {
        sleep_until(last_ns + kFramePeriodNs);
        const std::int64_t now_ns = monotonic_now_ns();
        playback.advance(seconds(now_ns - last_ns));
        last_ns = now_ns;
    }
    return 0;
}

}  // namespace

Command add_play_command(CLI::App& app) {
    const auto options = std::make_shared<PlayOptions>();
    app.add_option("record", options->record,
                   "Recording by host-sim run --record, which names its scene; or, with --scene, any CSV with time_s, "
                   "x_m, y_m, "
                   "z_m in the device frame, such as rt-core's")
        ->required();
    const CLI::Option* const view =
        app.add_option("--view", options->view_address,
                       "Serve the live view to browsers at this address of this machine; without ADDR:PORT, to this "
                       "machine only "
                       "[127.0.0.1:7060]. Every viewer may seek, pause and change the speed for all viewers")
            ->type_name("[ADDR:PORT]")
            ->expected(0, 1);
    app.add_flag("--watch-only", options->watch_only, "Viewers may not seek, pause or change the speed");
    app.add_option("--scene", options->scene,
                   "Built-in scene or scene file in place of the record's own; the hand is followed over time")
        ->type_name("SCENE");
    app.add_option("--set", options->assignments, "Override a scene key; repeatable")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    return [options, view] {
        log_to_stderr("host-sim");
        return play(*options, view->count() > 0);
    };
}

}  // namespace haptic::sim
