// What a viewer may ask of a run. All but looking needs --view-control; the view refuses it otherwise, and the run
// never sees it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>

#include "haptic/types.hpp"

namespace haptic::sim::view {

/// A parameter of the scene's description gets another value, which is within its range.
struct SetParameter {
    std::size_t parameter = 0;
    double value = 0.0;
};
struct SetPaused {
    bool paused = false;
};
/// Of a paused run.
struct SingleStep {
    int steps = 1;  // 1 .. 1000
};
/// The scene from its start, with the parameters as they are.
struct Reset {};
/// Another built-in scene, one of those that the description lists.
struct ChangeScene {
    std::string name;
};
/// From here on each step is kept, or no longer.
struct SetRecording {
    bool on = false;
};
/// The mouse has the hand, at a place of the scene.
struct MoveHand {
    Vec3 position{0.0};               // m, scene; within kFarthestHand
    std::optional<Quat> orientation;  // unit, scene_from_tool; none: as it is
    std::optional<double> curl;       // 0 .. 1; none: as it is
};
/// The mouse lets the hand go: it stays where it is.
struct ReleaseHand {};
/// The hand goes back to the scene's script.
struct FollowScript {};
/// Of a recording: goes on from there.
struct Seek {
    double time = 0.0;  // s, from its start
};
/// Of a recording: simulated seconds a second.
struct SetSpeed {
    double speed = 1.0;  // 0.01 .. 10
};

using Command = std::variant<SetParameter, SetPaused, SingleStep, Reset, ChangeScene, SetRecording, MoveHand,
                             ReleaseHand, FollowScript, Seek, SetSpeed>;

inline constexpr double kFarthestHand = 1000.0;  // m, of each coordinate

}  // namespace haptic::sim::view
