// Tool model: the tool that the hand holds, as a mesh, the oriented particles that deform it, and one proxy sphere per
// particle.
//
// Spheres are fitted to any mesh (sphere_cover.hpp) or given by number and radius. Particles sit at their centres;
// groups and skin are built as for any other body (model_builder.hpp). Its material and the coupling to the hand make
// its shape among surfaces (tool_proxies.hpp); nothing of it is integrated.
//
// Thin objects can pass between spheres (thesis, figure 5.9). `close_gaps` adds spheres until neighbours overlap, and
// continue to overlap when the tool is stretched by a tenth.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "haptic/config.hpp"
#include "haptic/frames.hpp"
#include "haptic/sim/deformable.hpp"
#include "haptic/sim/progress.hpp"
#include "haptic/sim/tool_joints.hpp"
#include "haptic/sim/tool_material.hpp"

namespace haptic::sim {

enum class ToolShape : std::uint8_t { Sphere, Hand, Rod, Probe };

/// Table [tool] of a scene. Lengths in m, scene.
struct ToolSettings {
    static constexpr std::size_t kMaxSpheres = kMaxProxies;

    ToolShape shape = ToolShape::Sphere;
    double length = 0.19;       // of hand, rod and probe, end to end; of a mesh file unless file_scale is given
    double thickness = 0.02;    // diameter of the rod, and of the probe's shaft
    double ball_radius = 0.02;  // of the sphere; of the ball at the probe's end
    std::string file;           // mesh file, replaces the generated mesh; empty: none
    double file_scale = 0.0;    // m per unit of the file; 0: centred and scaled to `length`

    std::size_t spheres = 0;   // 0: as many as cover_error requires; at most kMaxSpheres
    double radius = 0.0;       // of all spheres; 0: each fits the mesh
    double cover_error = 0.0;  // used if spheres is 0; 0: 37 spheres for the hand, else 0.02 of the longest side
    bool close_gaps = false;   // adds spheres between neighbours that leave a gap

    std::size_t neighbours = 8;  // 1 to 32, number that form an elastic element with each particle

    ToolMaterial material;

    // Closing: the generated hand only (tool_joints.hpp). A script in the scene overrides the button (Scene::curl).
    double curl = 0.0;         // 0..1, at the start, and while the button is released
    int close_button = -1;     // 0 to 31: button of the grip that closes the hand while held; -1: none
    double close_to = 1.0;     // 0..1, curl to which the button closes the hand
    double close_speed = 2.0;  // 1/s, rate of change of the curl

    Placement grip;  // grip_from_tool: pose of the tool in the grip frame; velocities unused
};

struct ToolModel {
    DeformableBody body;         // rest shape, grip frame, scene units; at most kMaxSpheres particles
    std::vector<double> radius;  // m, per particle
    std::vector<double> volume;  // m^3, per particle: parts of the mesh's volume; of an open mesh: of the spheres
    ToolMaterial material;
    ToolJoints joints;      // bound to the particles, grip frame; empty unless the tool can close
    std::size_t added = 0;  // number of spheres that close gaps; they are the last ones
    /// m: no surface point is farther from a sphere, and no sphere stands farther out of the mesh (of an open mesh: off
    /// it). A proven upper bound, tight to 1 %.
    double cover_error = 0.0;
    /// m: diameter of the thickest rod that passes between neighbouring spheres; 0: no gap between two or three of
    /// them.
    double widest_gap = 0.0;
};

/// Reads the table [tool]. Throws ConfigError.
[[nodiscard]] ToolSettings read_tool(const Config& config);

/// Tool of one sphere about the origin: no constraints and no mesh. `radius` in m, positive.
[[nodiscard]] ToolModel one_sphere(double radius);

/// Builds the tool, the same bits on every machine. Throws std::invalid_argument: a setting out of range; more spheres
/// needed than allowed, with the number. Throws MeshError for an unreadable file.
[[nodiscard]] ToolModel make_tool(const ToolSettings& settings, const Progress& progress = {});

}  // namespace haptic::sim
