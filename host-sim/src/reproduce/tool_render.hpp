// A tool of many particles as a haptic loop at 1 kHz feels it, and as it looks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "haptic/frames.hpp"
#include "reproduce/povray.hpp"
#include "haptic/sim/simulation.hpp"
#include "haptic/types.hpp"
#include "reproduce/scene_run.hpp"

namespace haptic::sim::reproduce {

/// One millisecond of haptic rendering, in the scene.
struct ToolSample {
    double time_s = 0.0;
    Vec3 hip{0.0};             // m, where the hand has the tool's origin
    Vec3 force{0.0};           // N, on the hand
    Vec3 torque{0.0};          // N*m, on the hand, about the hip
    std::size_t collided = 0;  // particles that make it
};

/// What a frame makes of the scripted hand at each whole millisecond from `from_ns` until before `until_ns`. Particle i
/// of N has its goal where the hand has it; it is held at the nearest point in its half-spaces, which move on with
/// their velocities, or, if the frame holds positions (thesis, section 5.4.1), at its position. The force is k sum d_i
/// / N, the torque k_t sum r_i x d_i / N (thesis, section 5.2.2). So does rt-core, with limits, smoothing and damping
/// on top.
void render_tool(const Simulation& simulation, const ContactFrame& frame, std::int64_t from_ns, std::int64_t until_ns,
                 std::vector<ToolSample>& samples);

/// A picture with a tool. It points into itself and into the run.
struct ToolPicture {
    std::vector<Vec3> tool;    // vertices of its skin
    std::vector<Vec3> device;  // the same, where the hand has it
    PictureScene scene;
};

enum class ToolLook : std::uint8_t {
    Skin,    // the tool, and grey where the hand has it
    Spheres  // its proxies, those in contact in another colour, and its skin as if of glass
};

/// The scene as the last step found it, with what it made of the tool.
[[nodiscard]] ToolPicture tool_picture(const SceneRun& run, const std::string& title, ToolLook look);

}  // namespace haptic::sim::reproduce
