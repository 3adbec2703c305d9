// Hand sources: decide what moves the hand in a run. The first available one of
//
//   1. a recording (--input)
//   2. the device, while rt-core publishes fresh states; viewers cannot take the hand from it
//   3. a viewer's mouse that drags the hand through the scene
//   4. the scene's script, or a hostile hand; in a real-time run without a live view the hand stays in place instead
//
// When the device disappears or the mouse lets go, the hand stays in place until another source takes it, it is
// returned to the script, or the scene restarts or another one is loaded.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "app/hand.hpp"
#include "app/recorded_run.hpp"
#include "haptic/sim/simulation.hpp"
#include "scene/hostile_hand.hpp"
#include "view/command.hpp"
#include "view/snapshot.hpp"

namespace haptic::sim {

struct HandSettings {
    std::string input;                          // file of a recording; empty: none
    std::optional<std::uint64_t> hostile_seed;  // replaces the script
    bool scripted = true;                       // the hand follows the script unless another source has it
};

class HandSources {
  public:
    /// `states` may be null: no device. Throws CsvError for an invalid recording.
    HandSources(const HandSettings& settings, RingReader<DeviceState>* states);

    /// To be called for each new simulation: puts the hand at the start of its script, and lets it follow the script
    /// unless a recording or the device has it.
    void begin(const Simulation& simulation);

    struct Times {
        std::int64_t scene_ns = 0;  // since the scene's start, for scripts and recordings
        std::int64_t step_ns = 0;   // StepInput::time_ns
        std::int64_t now_ns = 0;    // CLOCK_MONOTONIC
    };
    /// Input for the next step.
    [[nodiscard]] StepInput at(const Simulation& simulation, const Times& times);

    // Viewers' commands; no effect while a recording or the device has the hand.
    void move(const Simulation& simulation, const view::MoveHand& where);
    void release() noexcept;
    void follow_script(const Simulation& simulation);

    [[nodiscard]] view::HandSource source() const noexcept { return source_; }
    /// The device appeared in the last call of at().
    [[nodiscard]] bool device_appeared() const noexcept { return device_appeared_; }
    /// Null: no device.
    [[nodiscard]] DeviceHand* device() noexcept { return device_ ? &*device_ : nullptr; }

  private:
    void follow_mouse(const Simulation& simulation, StepInput& input);
    void play_script(const Simulation& simulation, std::int64_t time_ns, StepInput& input);
    [[nodiscard]] bool is_locked() const noexcept;

    std::optional<DeviceHand> device_;
    std::optional<RecordedRun> input_;
    std::optional<std::uint64_t> hostile_seed_;
    std::optional<HostileHand> hostile_;
    view::HandSource without_others_;  // source while no other has the hand
    view::HandSource source_;
    bool device_appeared_ = false;
    StepInput last_;   // last result of at()
    Pose mouse_;       // m, scene: position of the hand, lagging behind
    Pose mouse_goal_;  // the mouse
    std::optional<double> mouse_curl_;
    std::optional<Pose> returning_from_;  // m, scene: start of the return to the script
    double returning_s_ = 0.0;
};

}  // namespace haptic::sim
