// Camera of a picture: where it stands to show the framed box, and from which direction the tool is hidden least.
#pragma once

#include <span>

#include "haptic/types.hpp"
#include "reproduce/povray.hpp"

namespace haptic::sim {

struct Camera {
    Vec3 position{0.0};     // m, scene
    Vec3 look_at{0.0};      // m, scene: middle of the framed box
    double distance = 0.0;  // m, from `look_at`
};

inline constexpr double kCameraAngle = 30.0;  // degrees, horizontal field of view

/// Camera in a direction from the middle that sees PictureScene::view, or else everything, with a margin.
[[nodiscard]] Camera camera_for(const PictureScene& scene, const Vec3& direction);

/// Share (0..1) of the points that no object of the scene hides from the camera; 1 without points.
[[nodiscard]] double visible_share(const PictureScene& scene, const Camera& camera, std::span<const Vec3> points);

/// Picture of one moment, and the points in it that should be seen.
struct Subject {
    const PictureScene* picture = nullptr;
    std::span<const Vec3> points;  // m, scene
};

/// Direction, for PictureScene::camera, in which the points of all moments are hidden least. Directions from slightly
/// above are preferred among those that show nearly as much; the camera always stands above the ground.
[[nodiscard]] Vec3 clearest_direction(std::span<const Subject> subjects);

}  // namespace haptic::sim
