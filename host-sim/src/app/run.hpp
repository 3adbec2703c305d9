// Run: executes a scene from start to end, in lockstep (as fast as possible), in real time or in the device's time,
// with or without viewers.
//
//     viewers' commands -> hand -> step -> contact frame to the ring -> statistics, records -> snapshot to the viewers
//
// With viewers a run can be idle: paused, or while another scene is built on a thread of its own. Viewers and the
// haptic loop are served meanwhile (contact_frame_publisher.hpp).
#pragma once

#include <cstdint>
#include <future>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "app/contact_frame_publisher.hpp"
#include "app/hand_sources.hpp"
#include "app/live_control.hpp"
#include "app/random_settings.hpp"
#include "app/recordings.hpp"
#include "app/run_options.hpp"
#include "app/run_statistics.hpp"
#include "app/snapshots.hpp"
#include "app/stop_signal.hpp"
#include "haptic/histogram.hpp"
#include "haptic/probe.hpp"
#include "haptic/ring.hpp"
#include "haptic/sim/simulation.hpp"
#include "program/progress_bar.hpp"
#include "program/results.hpp"

namespace haptic::sim {

class Run {
  public:
    /// `view` may be null: no viewers. Throws if rings, probe or files cannot be opened.
    Run(const RunOptions& options, const Plan& plan, std::unique_ptr<view::LiveView> view);
    /// Runs to the end and returns the exit status.
    int execute();

  private:
    /// A simulation under construction that will replace the current one.
    struct NextScene {
        Scene scene;
        RecordNotes origin;
        std::future<Simulation> made;
    };

    /// A published contact frame; sequence 0: none.
    struct Published {
        std::uint64_t sequence = 0;
        std::int64_t time_ns = 0;
    };

    void start_scene();
    void run_lockstep();
    void run_real();
    void run_device();
    void wait_for_device();
    void make_step(const HandSources::Times& times);
    void change_settings_at_random();
    bool try_step(const StepInput& input, StepResult& result);
    [[nodiscard]] Published publish(const StepInput& input);
    void update_viewers(const StepResult& result, const Published& frame);
    void report_stiffness_limit(const StepInput& input);
    void follow_workspace(std::int64_t now_ns);
    void log_device_freshness();
    bool serve();
    void idle();
    void carry_over_changes(NextScene& next) const;
    void start_next_scene(const SceneRequest& request);
    void switch_to_next_scene();
    [[nodiscard]] double part_done() const;
    [[nodiscard]] bool should_continue();
    [[nodiscard]] nlohmann::json probe_report() const;
    [[nodiscard]] nlohmann::json view_report() const;
    [[nodiscard]] nlohmann::json report(double wall_s) const;
    void write_results(double wall_s, Results& results);
    void run_clock();

    const StopOnSignal stop_;  // first member: outlives the rings
    const RunOptions& options_;
    std::string session_;
    std::uint64_t steps_;  // 0: any number
    double duration_s_;    // 0: without an end
    RunClock clock_;
    Scene scene_;                  // at its start
    LiveSettings scene_settings_;  // the scene's own, before any change
    RecordNotes origin_;
    Simulation simulation_;
    RunStatistics statistics_;
    Recordings recordings_;
    std::unique_ptr<Snapshots> snapshots_;
    std::shared_ptr<WorkspaceFile> workspace_;
    std::unique_ptr<ContactFramePublisher> frames_;
    std::unique_ptr<RingReader<DeviceState>> states_;
    HandSources hand_;
    std::optional<std::uint64_t> settings_seed_;
    std::optional<RandomSettings> random_settings_;
    std::unique_ptr<LiveControl> live_;
    std::optional<NextScene> next_;
    bool was_idle_ = false;      // before the next step
    bool unstable_ = false;      // the simulation has diverged and must not be shown
    Probe step_probe_;           // high during each step
    std::int64_t start_ns_ = 0;  // start of the current simulation
    std::int64_t scene_ns_ = 0;
    std::uint64_t late_ = 0;
    Histogram viewer_times_;  // time that viewers cost per step
    std::uint64_t workspace_changes_ = 0;
    bool was_fresh_ = true;  // true, so that a device missing from the start is logged
    bool told_stiffness_limit_ = false;
    std::optional<ProgressBar> progress_;  // while the clock of a run of limited length runs
};

}  // namespace haptic::sim
