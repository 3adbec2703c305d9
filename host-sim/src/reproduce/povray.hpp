// A moment of a simulation as a POV-Ray scene, for a picture.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <haptic/sim/mesh.hpp>
#include <haptic/sim/simulation.hpp>
#include <haptic/types.hpp>

namespace haptic::sim {

/// One surface of a picture.
struct PictureObject {
    std::span<const Vec3> vertices;   // m
    std::vector<Triangle> triangles;  // one face of each; indices into `vertices`
    bool closed = false;              // its inside is never seen; else the backs have a colour of their own
    std::array<double, 3> colour{0.78, 0.16, 0.14};
    bool ghost = false;    // grey and transparent: where it was before
    bool faceted = false;  // each triangle flat, instead of smoothed over its neighbours
};

/// One sphere of a tool.
struct PictureSphere {
    Vec3 centre{0.0};     // m
    double radius = 0.0;  // m
    bool touching = false;
};

/// A part of space between two corners, m.
struct PictureBox {
    Vec3 low{0.0};
    Vec3 high{0.0};
};

struct PictureScene {
    std::string title;  // a comment at the top of the file
    std::vector<PictureObject> objects;
    Vec3 proxy{0.0};
    double proxy_radius = 0.03;  // m; 0: neither proxy nor hip are drawn
    Vec3 hip{0.0};
    double floor = -1.5;                 // m, height of the ground
    double tile = 0.25;                  // m, of the ground's pattern
    Vec3 camera{0.45, 0.2, 1.0};         // direction in which the camera is, seen from the middle
    std::vector<PictureSphere> spheres;  // of a tool, in place of the proxy
    std::optional<PictureBox> view;      // what the picture has to show; none: all of it
};

/// The bodies of a simulation as they are, in the order of Simulation::bodies(), each in a colour of its own. The
/// vertices are not copied: they are those of `vertices`, one for each of Simulation::vertices().
[[nodiscard]] std::vector<PictureObject> objects_of(const Simulation& simulation, std::span<const Vec3> vertices);

/// Writes the file (to a temporary one beside it that is renamed into place); `povray FILE +W1600 +H1200 +A` renders
/// it. Throws std::runtime_error that names the file.
void write_picture_scene(const std::filesystem::path& file, const PictureScene& scene);

}  // namespace haptic::sim
