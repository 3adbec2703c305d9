// Scene trial: does a grip that is held in a host-sim scene come to rest? The scene's bodies are soft and move, and the
// hand is compliant. Runs the whole tick against the emulated board and its mechanics, joined by real rings to
//
//     host-sim run SCENE --clock device --session S
//
// Both take their time from the tick's virtual clock: host-sim steps when the device states have advanced by a step,
// and the trial waits for the frame, which the tick receives `delay_ns` after the state that it answers. The outcome
// therefore depends on the settings only.
//
// The hand follows a track and then stays. Amplitudes are those of the grip, peak to peak along the axis where they are
// largest, in the first and the last window of 1.2 s of a still hand, with the linear trend removed.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "haptic/device/grip_mechanics.hpp"
#include "haptic/pose_track.hpp"
#include "tick/tick_settings.hpp"

namespace haptic::rt {

inline constexpr double kSceneWindowS = 1.2;  // s, over which an amplitude is measured: a period of the fish's tail
inline constexpr double kSceneSettleS = 0.4;  // s, between the end of the hand's motion and the first window

struct SceneTrial {
    std::string session;              // of the rings to host-sim
    std::function<bool()> peer_runs;  // host-sim has not ended
    std::int64_t delay_ns = 0;        // of each frame; at least one tick passes
    PoseTrack hand{Pose{}};           // device frame; time 0 is the scene's first step
    double moving_s = 0.0;            // s, after which the hand is still
    double still_s = 16.0;            // s, for which it is; at least kSceneSettleS + 2 kSceneWindowS
    TickSettings tick;
    device::GripMechanics mechanics;
};

struct SceneOutcome {
    double stiffness = 0.0;        // N/m at the hand, of the first frame
    double first_amplitude = 0.0;  // m
    double last_amplitude = 0.0;   // m
    double min_energy = 0.0;       // J, of the passivity observer
    double peak_force = 0.0;       // N, rendered
    double touching = 0.0;         // fraction of the still time in which something presses on the hand
    double controlled = 0.0;       // fraction of ticks in which the passivity controller acted
    std::uint32_t faults = 0;      // HAPTIC_FAULT_*; they end the trial
};

/// Runs one trial. Throws std::invalid_argument, RingError, and std::runtime_error if the tick does not reach Running
/// or host-sim ends or stays silent for a minute.
[[nodiscard]] SceneOutcome run_scene_trial(const SceneTrial& trial);

}  // namespace haptic::rt
