// The tool that the hand holds: a mesh, the oriented particles that deform it, and a sphere about each particle, which
// is its proxy.
//
// The spheres are found for any mesh (sphere_cover.hpp), or are as many and as large as asked for. Particles sit in
// their centres; masses, groups and skin are made about them as for any other body (model_builder.hpp). A tool has no
// state of its own: each step begins at its rest shape where the hand is (thesis, section 5.2.4), so nothing of it is
// integrated.
//
// Where spheres leave gaps, what is thin gets between them (thesis, figure 5.9). `close_gaps` puts further spheres
// between neighbours until the neighbours overlap, and go on overlapping while the tool is stretched by a tenth.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "haptic/config.hpp"
#include "haptic/frames.hpp"
#include "haptic/sim/deformable.hpp"
#include "haptic/sim/tool_joints.hpp"

namespace haptic::sim {

enum class ToolShape : std::uint8_t { Sphere, Hand, Rod, Probe };

/// The table [tool] of a scene. Lengths are m, in the scene.
struct ToolSettings {
    static constexpr std::size_t kMostSpheres = kMaxProxies;

    ToolShape shape = ToolShape::Sphere;
    double length = 0.19;       // of hand, rod and probe, from end to end; of a file's mesh unless file_scale is given
    double thickness = 0.02;    // diameter of the rod, and of the probe's shaft
    double ball_radius = 0.02;  // of the sphere, and of the ball at the probe's end
    std::string file;           // of a mesh that takes the place of what is generated; empty: none
    double file_scale = 0.0;    // m per unit of the file; 0: centred, and as long as `length`

    std::size_t spheres = 0;   // 0: as many as cover_error asks for; to kMostSpheres
    double radius = 0.0;       // of each sphere; 0: each has its own, as it fits into the mesh
    double cover_error = 0.0;  // used if spheres is 0; 0: 37 spheres for the hand, else 0.02 of the longest side
    bool close_gaps = false;   // further spheres between neighbours that leave a gap

    std::size_t neighbours = 8;    // 1 to 32, that make a group with each particle
    double mass = 1.0;             // kg, of the whole tool; only the ratios of its particles' masses matter
    double group_stiffness = 0.6;  // 0..1, of shape matching
    double link_stiffness = 0.0;   // 0..1, of a distance constraint to each neighbour; 0: there are none
    int iterations = 4;            // of the tool's own constraints, a step (thesis, section 5.5.1)

    // Of the hand, which alone can close (tool_joints.hpp). A script says how far it is closed (Scene::curl).
    double curl = 0.0;         // 0..1, where it begins, and while the button is not held
    int close_button = -1;     // of the grip, 0 to 31: closes the hand while it is held; -1: none does
    double close_to = 1.0;     // 0..1, the curl to which the button closes it
    double close_speed = 2.0;  // 1/s, of the curl

    Placement grip;  // grip_from_tool: where the tool's origin is in the grip's frame; without velocity
};

struct ToolModel {
    DeformableBody body;         // rest shape in the grip's frame, in scene units; at most kMostSpheres particles
    std::vector<double> radius;  // m, of the sphere about each particle
    int iterations = 0;          // see ToolSettings
    ToolJoints joints;           // of the particles, in the grip's frame; none if it keeps its shape
    std::size_t added = 0;       // of the spheres, the last ones: those that close gaps
    /// m: no point of the mesh's surface is farther than this from a sphere, and no sphere stands out of the mesh (of
    /// an open one: off it) farther than this. An upper bound, proven to 1 % of it, not an estimate.
    double cover_error = 0.0;
    /// m: the thickness of the thickest rod that fits between the spheres of neighbours; 0: all overlap, and no gap is
    /// left between three of them.
    double widest_gap = 0.0;
};

/// Reads the table [tool]. Throws ConfigError.
[[nodiscard]] ToolSettings read_tool(const Config& config);

/// Makes the tool; the same, bit for bit, on every machine. Throws std::invalid_argument: a setting out of its range,
/// more spheres needed than there may be, saying how many; MeshError for a file that cannot be read.
[[nodiscard]] ToolModel make_tool(const ToolSettings& settings);

}  // namespace haptic::sim
