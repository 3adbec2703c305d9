// Viewer commands: the requests that change a run. All of them need --view-control; without it the view refuses them
// and the run never sees them.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>

#include "haptic/types.hpp"

namespace haptic::sim {
struct Scene;
}

namespace haptic::sim::view {

/// Sets a parameter of the scene's description, by index, to a value within its range.
struct SetParameter {
    std::size_t parameter = 0;
    double value = 0.0;
};
struct SetPaused {
    bool paused = false;
};
/// Steps a paused run.
struct SingleStep {
    int steps = 1;  // 1 .. 1000
};
/// Restarts the scene with the current parameters.
struct Reset {};
/// Loads another scene: a built-in one, one of those that the description lists, or one made for a viewer's mesh.
struct ChangeScene {
    std::string name;
    std::shared_ptr<const Scene> made{};  // null: the built-in scene of that name
};
/// Starts or stops the recording of steps.
struct SetRecording {
    bool on = false;
};
/// Gives the hand to the mouse, at a position in the scene.
struct MoveHand {
    Vec3 position{0.0};               // m, scene; within kMaxHandCoordinate
    std::optional<Quat> orientation;  // unit, scene_from_tool; none: unchanged
    std::optional<double> curl;       // 0 .. 1; none: unchanged
};
/// Releases the hand, which stays where it is.
struct ReleaseHand {};
/// Returns the hand to the scene's script.
struct FollowScript {};
/// Moves the playback of a recording to a time.
struct Seek {
    double time = 0.0;  // s, from its start
};
/// Sets the playback speed, in simulated seconds per second.
struct SetSpeed {
    double speed = 1.0;  // 0.01 .. 10
};

using Command = std::variant<SetParameter, SetPaused, SingleStep, Reset, ChangeScene, SetRecording, MoveHand,
                             ReleaseHand, FollowScript, Seek, SetSpeed>;

inline constexpr double kMaxHandCoordinate = 1000.0;  // m, limit of each coordinate

}  // namespace haptic::sim::view
