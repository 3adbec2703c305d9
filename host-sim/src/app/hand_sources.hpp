// Who moves the hand in a run. In this order, the first one that is there:
//
//   1. a recording that was given (--input)
//   2. the device, while rt-core publishes fresh states: no viewer takes the hand from who holds it
//   3. the mouse of a viewer, who drags the hand through the scene
//   4. the scene's script, or a hostile hand; without a live view a paced run leaves the hand where it is instead
//
// When the device goes, or the mouse lets go, the hand stays where it was until somebody takes it, or until it is given
// back to the script.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "app/hand.hpp"
#include "app/recorded_run.hpp"
#include "scene/hostile_hand.hpp"
#include <haptic/sim/simulation.hpp>
#include "view/command.hpp"
#include "view/snapshot.hpp"

namespace haptic::sim {

struct HandSettings {
    std::string input;                          // a recording; empty: none
    std::optional<std::uint64_t> hostile_seed;  // in place of the script
    bool scripted = true;                       // the hand follows the script as long as nobody has taken it
};

class HandSources {
  public:
    /// `states` may be null: there is no device. Throws CsvError for what is wrong with the recording.
    HandSources(const HandSettings& settings, RingReader<DeviceState>* states);

    /// A scene begins: its hand is where its script begins.
    void begin(const Simulation& simulation);

    struct Times {
        std::int64_t scene_ns = 0;  // since the scene's start, for scripts and recordings
        std::int64_t step_ns = 0;   // StepInput::time_ns
        std::int64_t now_ns = 0;    // CLOCK_MONOTONIC
    };
    /// The input of the step that begins.
    [[nodiscard]] StepInput at(const Simulation& simulation, const Times& times);

    // What viewers ask for; of no effect while a recording or the device has the hand.
    void move(const Simulation& simulation, const view::MoveHand& where);
    void release() noexcept;
    void follow_script(const Simulation& simulation);

    [[nodiscard]] view::HandSource source() const noexcept { return source_; }
    /// The device came between the last two calls of at().
    [[nodiscard]] bool device_came() const noexcept { return device_came_; }
    /// Null: there is none.
    [[nodiscard]] DeviceHand* device() noexcept { return device_ ? &*device_ : nullptr; }

  private:
    void follow_mouse(const Simulation& simulation, StepInput& input);
    void play_script(const Simulation& simulation, std::int64_t time_ns, StepInput& input);
    [[nodiscard]] bool taken() const noexcept;

    std::optional<DeviceHand> device_;
    std::optional<RecordedRun> input_;
    std::optional<std::uint64_t> hostile_seed_;
    std::optional<HostileHand> hostile_;
    view::HandSource source_;
    bool device_came_ = false;
    StepInput last_;  // what at() gave
    Pose mouse_;      // m, scene: where the hand is on its way to
    Pose mouse_goal_;
    std::optional<double> mouse_curl_;
    std::optional<Pose> returning_from_;  // m, scene: on the way back to the script
    double returning_s_ = 0.0;
};

}  // namespace haptic::sim
