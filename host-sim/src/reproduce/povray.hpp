// POV-Ray export: a snapshot of a simulation as a scene file for a rendered picture.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "haptic/sim/mesh.hpp"
#include "haptic/sim/simulation.hpp"
#include "haptic/types.hpp"
#include "simd/aabb.hpp"

namespace haptic::sim {

/// One surface of a picture.
struct PictureObject {
    std::span<const Vec3> vertices;   // m
    std::vector<Triangle> triangles;  // without duplicate back faces; indices into `vertices`
    bool closed = false;              // its inside is never seen; otherwise the back faces have a colour of their own
    std::array<double, 3> colour{0.78, 0.16, 0.14};
    bool ghost = false;      // grey and transparent, e.g. a previous position
    bool faceted = false;    // flat triangles instead of smooth shading
    bool tool = false;       // the skin of the tool
    double transmit = 0.16;  // 0..1, of an open surface: slightly transparent, so that the proxy behind it is visible
};

/// One sphere of a tool.
struct PictureSphere {
    Vec3 centre{0.0};     // m
    double radius = 0.0;  // m
    bool touching = false;
};

struct PictureScene {
    std::string title;  // a comment at the top of the file
    std::vector<PictureObject> objects;
    Vec3 proxy{0.0};
    double proxy_radius = 0.03;  // m; 0: neither proxy nor hip is drawn
    Vec3 hip{0.0};
    double floor = -1.5;                  // m, height of the ground
    double tile = 0.25;                   // m, of the ground's checker pattern
    Vec3 camera{0.45, 0.2, 1.0};          // direction of the camera, seen from the middle
    std::vector<PictureSphere> spheres;   // of a tool, instead of the proxy
    std::vector<PictureSphere> contacts;  // marks where the tool touches
    std::optional<Aabb> view;             // what must be visible; none: everything
};

/// The bodies of a simulation, in the order of Simulation::bodies(), each in a colour of its own. They refer to
/// `vertices`, one for each of Simulation::vertices().
[[nodiscard]] std::vector<PictureObject> objects_of(const Simulation& simulation, std::span<const Vec3> vertices);

/// Writes the file, through a temporary one beside it that is renamed; `povray FILE +W1600 +H1200 +A` renders it.
/// Throws std::runtime_error that names the file.
void write_picture_scene(const std::filesystem::path& file, const PictureScene& scene);

}  // namespace haptic::sim
