// Human-like hand: minimum-jerk strokes about a scene's script, with tremor, as a tracker at 1 kHz sees it.
#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "haptic/pose_track.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/types.hpp"

namespace haptic::test {

constexpr int kHandRampMs = 600;  // ms, from the device's centre to the start of the script

/// Part of a scene's script that a hand follows.
struct HandTrace {
    std::string scene;
    double from_s;      // of the script
    double duration_s;  // after the ramp
    /// s after the ramp: from then on the closing button is held; negative: never.
    double closes_s = -1.0;
    /// Settings of the scene, as on the command line.
    std::vector<std::string> settings{};
    double quantum = 1e-3;  // m, of the tracker; 0: exact
};

/// For the names of parameterised tests.
std::ostream& operator<<(std::ostream& out, const HandTrace& trace);

/// The scene with these settings.
[[nodiscard]] sim::Scene scene_of(const HandTrace& trace);

/// Minimum-jerk strokes between points near the script's path, with tremor, quantised. The script starts after the
/// ramp.
[[nodiscard]] PoseTrack human_hand(const sim::Scene& scene, const HandTrace& trace);

}  // namespace haptic::test
