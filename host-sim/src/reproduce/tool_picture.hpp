// Pictures of a tool of many proxies in its scene.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "haptic/types.hpp"
#include "reproduce/povray.hpp"
#include "reproduce/scene_run.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::sim::reproduce {

/// What a picture shows of a tool at one moment.
struct ToolMoment {
    std::vector<Vec3> skin;               // m, scene: mesh vertices as deformed; empty for a tool without a mesh
    std::vector<PictureSphere> spheres;   // its proxies
    std::vector<PictureSphere> contacts;  // marks at the points where proxies in contact touch a surface
};

/// Copies the tool as the last step left it; reuses the memory of `moment`.
void capture(const ToolProxies& tool, ToolMoment& moment);

/// The skin as an object of a picture; it refers to `vertices`. Requires a tool with a mesh.
[[nodiscard]] PictureObject skin_object(const ToolProxies& tool, const std::vector<Vec3>& vertices);

/// A picture with a tool. `scene` refers to the vectors beside it and to the run.
struct ToolPicture {
    std::vector<Vec3> tool;    // m, vertices of its skin
    std::vector<Vec3> device;  // m, the same at the device's pose
    PictureScene scene;
};

enum class ToolStyle : std::uint8_t {
    Skin,    // the skin; in contact also a grey copy at the device's pose
    Spheres  // its proxies, those in contact in another colour, and a transparent skin
};

/// The scene as the last step found it, with the tool that this step produced.
[[nodiscard]] ToolPicture tool_picture(const SceneRun& run, const std::string& title, ToolStyle style);

/// A picture to be taken at a time of a run.
struct Shot {
    double time_s;
    const char* name;
    const char* caption;
    Vec3 camera;  // direction of the camera, seen from the middle
};

}  // namespace haptic::sim::reproduce
