// A run and its viewers: shows them the moments, and does what they ask for.
//
// What they ask is done between two steps, in the order in which it was asked. A scene that is to begin anew, or
// another one, is for the run to make (take_wish()).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "app/hand_sources.hpp"
#include "app/recordings.hpp"
#include <haptic/sim/simulation.hpp>
#include "view/live_parameters.hpp"
#include "view/live_view.hpp"

namespace haptic::sim {

/// Another simulation is wanted in place of this one.
struct SceneWish {
    std::string scene;  // a built-in one; empty: the present one from its start
};

/// What was asked for so far.
struct ViewCounts {
    std::uint64_t changes = 0;  // of parameters
    std::uint64_t resets = 0;
    std::uint64_t scenes = 0;  // changes of the scene
};

class LiveControl {
  public:
    LiveControl(std::unique_ptr<view::LiveView> view, Recordings& recordings)
        : view_(std::move(view)), recordings_(recordings) {}

    /// A simulation begins, which all that follows is about. `own` are the settings that its scene has by itself.
    void introduce(Simulation& simulation, const LiveSettings& own, HandSources& hand);

    /// Does what viewers have asked for since the last call.
    void serve();
    /// A step is not to be made now: the run is paused, and no single step is wanted.
    [[nodiscard]] bool stands() const noexcept { return paused_ && single_steps_ == 0; }
    [[nodiscard]] bool paused() const noexcept { return paused_; }
    [[nodiscard]] std::optional<SceneWish> take_wish();
    /// For what viewers have not asked for, but must see: nothing is stepped until they go on.
    void pause() noexcept { paused_ = true; }

    /// A step was made.
    void after_step(const StepResult& result, std::uint64_t late_steps, std::int64_t now_ns);
    /// Shows the moment, if somebody waits for one; also while the scene stands.
    void show(std::int64_t now_ns);
    void frame_published(std::uint64_t sequence, std::int64_t time_ns) { view_->frame_published(sequence, time_ns); }

    /// A wish was fulfilled.
    void count(bool other_scene) noexcept { ++(other_scene ? counts_.scenes : counts_.resets); }
    [[nodiscard]] const ViewCounts& counts() const noexcept { return counts_; }
    [[nodiscard]] std::string url() const { return view_->url(); }

  private:
    void obey(const view::SetParameter& command);
    void obey(const view::SetPaused& command);
    void obey(const view::SingleStep& command);
    void obey(const view::Reset& command);
    void obey(const view::ChangeScene& command);
    void obey(const view::SetRecording& command);
    void obey(const view::MoveHand& command);
    void obey(const view::ReleaseHand& command);
    void obey(const view::FollowScript& command);
    void obey(const view::Seek& /*command*/) {}      // of recordings
    void obey(const view::SetSpeed& /*command*/) {}  // likewise
    void measure_speed(std::int64_t now_ns);

    std::unique_ptr<view::LiveView> view_;
    Recordings& recordings_;
    Simulation* simulation_ = nullptr;
    HandSources* hand_ = nullptr;
    std::unique_ptr<view::LiveParameters> parameters_;  // of the simulation
    StepResult result_;                                 // of the last step
    bool paused_ = false;
    int single_steps_ = 0;  // still to be made though paused
    std::optional<SceneWish> wish_;
    ViewCounts counts_;
    std::uint64_t late_steps_ = 0;
    double speed_ = 0.0;            // simulated seconds a second
    double measured_s_ = 0.0;       // simulated, when the speed was last measured
    std::int64_t measured_ns_ = 0;  // and when that was
};

}  // namespace haptic::sim
