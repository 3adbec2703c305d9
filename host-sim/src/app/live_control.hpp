// Live control: executes viewers' commands on a run and shows them its state.
//
// Commands are executed between two steps, in the order of their arrival. Resets and changes of the scene are left to
// the run (take_request()).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "app/hand_sources.hpp"
#include "app/recordings.hpp"
#include "haptic/sim/simulation.hpp"
#include "view/live_parameters.hpp"
#include "view/live_view.hpp"

namespace haptic::sim {

/// Request for a new simulation.
struct SceneRequest {
    std::string scene;                    // its name; empty: restart the current one
    std::shared_ptr<const Scene> made{};  // null: the built-in scene of that name
};

/// Number of executed commands.
struct ViewCounts {
    std::uint64_t changes = 0;  // of parameters
    std::uint64_t resets = 0;
    std::uint64_t scenes = 0;  // changes of the scene
};

/// Changes a parameter from the next step on, and notes that in recordings. False: it is the same.
bool change_parameter(Simulation& simulation, const view::LiveParameters& parameters, const view::SetParameter& change,
                      Recordings& recordings);

class LiveControl {
  public:
    LiveControl(std::unique_ptr<view::LiveView> view, Recordings& recordings)
        : view_(std::move(view)), recordings_(recordings) {}

    /// Attaches to a new simulation. `own`: settings of its scene before any change.
    void introduce(Simulation& simulation, const LiveSettings& own, HandSources& hand);

    /// Executes the commands that arrived since the last call.
    void serve();
    /// Paused, without a single step to make.
    [[nodiscard]] bool is_idle() const noexcept { return paused_ && single_steps_ == 0; }
    [[nodiscard]] bool paused() const noexcept { return paused_; }
    [[nodiscard]] std::optional<SceneRequest> take_request();
    /// Pauses without a command, for an event that viewers must see.
    void pause() noexcept { paused_ = true; }

    /// To be called after each step.
    void after_step(const StepResult& result, std::uint64_t late_steps, std::int64_t now_ns);
    /// Shows the current state if a viewer waits for one; also while idle.
    void show(std::int64_t now_ns);
    void frame_published(std::uint64_t sequence, std::int64_t time_ns) { view_->frame_published(sequence, time_ns); }

    /// A request was fulfilled.
    void count(bool other_scene) noexcept { ++(other_scene ? counts_.scenes : counts_.resets); }
    [[nodiscard]] const ViewCounts& counts() const noexcept { return counts_; }
    [[nodiscard]] std::string url() const { return view_->url(); }

  private:
    void handle(const view::SetParameter& command);
    void handle(const view::SetPaused& command);
    void handle(const view::SingleStep& command);
    void handle(const view::Reset& command);
    void handle(const view::ChangeScene& command);
    void handle(const view::SetRecording& command);
    void handle(const view::MoveHand& command);
    void handle(const view::ReleaseHand& command);
    void handle(const view::FollowScript& command);
    void handle(const view::Seek& /*command*/) {}      // recordings only
    void handle(const view::SetSpeed& /*command*/) {}  // recordings only
    void measure_speed(std::int64_t now_ns);

    std::unique_ptr<view::LiveView> view_;
    Recordings& recordings_;
    Simulation* simulation_ = nullptr;
    HandSources* hand_ = nullptr;
    std::unique_ptr<view::LiveParameters> parameters_;  // of the current simulation
    StepResult result_;                                 // of the last step
    bool paused_ = false;
    int single_steps_ = 0;  // left to make while paused
    std::optional<SceneRequest> request_;
    ViewCounts counts_;
    std::uint64_t late_steps_ = 0;
    double speed_ = 0.0;            // simulated seconds per second
    double measured_s_ = 0.0;       // simulated time at the last measurement of the speed
    std::int64_t measured_ns_ = 0;  // clock time of that
};

}  // namespace haptic::sim
