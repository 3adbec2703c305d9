// A scene from its start to its end, under a virtual clock or the real one, alone or before viewers.
//
//     as fast as can be (lockstep), or at the scene's own deadlines (real):
//         what viewers asked for -> hand -> step -> frame to the ring -> statistics, records -> moment to the viewers
//
// With viewers the run may stand: paused, or while another scene is made, on a thread of its own. It then goes on
// serving them, and the haptic loop (frame_outlet.hpp).
#pragma once

#include <cstdint>
#include <future>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "app/frame_outlet.hpp"
#include "app/hand_sources.hpp"
#include "app/live_control.hpp"
#include "app/recordings.hpp"
#include "app/run_options.hpp"
#include "app/run_statistics.hpp"
#include "app/snapshots.hpp"
#include "app/stop_signal.hpp"
#include <haptic/histogram.hpp>
#include <haptic/probe.hpp>
#include <haptic/ring.hpp>
#include <haptic/sim/simulation.hpp>

namespace haptic::sim {

class Run {
  public:
    /// `view` shows it; null: nobody is shown anything. Throws for what cannot be had: rings, probe, files.
    Run(const RunOptions& options, const Plan& plan, std::unique_ptr<view::LiveView> view);
    /// The exit status.
    int go();

  private:
    /// A simulation that is being made in place of the present one.
    struct NextScene {
        Scene scene;
        RecordNotes origin;
        std::future<Simulation> made;
    };

    /// A frame that went to the ring; sequence 0: none did.
    struct Published {
        std::uint64_t sequence = 0;
        std::int64_t time_ns = 0;
    };

    void begin();
    void run_lockstep();
    void run_real();
    void wait_for_device();
    void one_step(const HandSources::Times& times);
    bool try_step(const StepInput& input, StepResult& result);
    [[nodiscard]] Published publish(const StepInput& input);
    void tell_viewers(const StepResult& result, const Published& frame);
    void follow_workspace(std::int64_t now_ns);
    void say_whether_fresh();
    bool serve();
    void stand();
    void keep_changes(NextScene& next) const;
    void make_next(const SceneWish& wish);
    void take_next();
    [[nodiscard]] bool wanted() const;
    [[nodiscard]] nlohmann::json probe_report() const;
    [[nodiscard]] nlohmann::json view_report() const;
    void write_results(double wall_s) const;

    const StopOnSignal stop_;  // first: from before there are rings until after there are none
    const RunOptions& options_;
    std::uint64_t steps_;  // 0: until stopped
    bool real_;
    Scene scene_;                // as it begins
    LiveSettings own_settings_;  // of the scene, before anything was changed
    RecordNotes origin_;
    Simulation simulation_;
    RunStatistics statistics_;
    Recordings recordings_;
    std::unique_ptr<Snapshots> snapshots_;
    std::shared_ptr<WorkspaceFile> workspace_;
    std::unique_ptr<FrameOutlet> frames_;
    std::unique_ptr<RingReader<DeviceState>> states_;
    HandSources hand_;
    std::unique_ptr<LiveControl> live_;
    std::optional<NextScene> next_;
    bool stood_ = false;         // before the step that comes
    bool broken_ = false;        // the simulation is no longer finite: not to be shown
    Probe step_probe_;           // up during each step
    std::int64_t begun_ns_ = 0;  // when the simulation did
    std::int64_t scene_ns_ = 0;
    std::uint64_t late_ = 0;
    Histogram telling_;  // what viewers cost a step
    std::uint64_t workspace_changes_ = 0;
    bool was_fresh_ = true;  // so that a device that is missing from the beginning is said
};

}  // namespace haptic::sim
