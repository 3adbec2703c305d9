// A moment of a simulation as a POV-Ray scene, for a picture.
#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "haptic/sim/mesh.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

struct PictureScene {
    std::string title;                    // a comment at the top of the file
    std::span<const Vec3> vertices;       // m
    std::span<const Triangle> triangles;  // those seen from their front; their backs are drawn in another colour
    Vec3 proxy{0.0};
    double proxy_radius = 0.03;  // m
    Vec3 hip{0.0};
    double floor = -1.5;         // m, height of the ground
    double camera_height = 0.2;  // of the camera above what it looks at, in parts of its distance
};

/// Writes the file (to a temporary one beside it that is renamed into place); `povray FILE +W1600 +H1200 +A` renders
/// it. Throws std::runtime_error that names the file.
void write_picture_scene(const std::filesystem::path& file, const PictureScene& scene);

}  // namespace haptic::sim
