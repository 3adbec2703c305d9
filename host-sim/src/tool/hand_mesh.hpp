// Hand mesh: a generated human hand, the tool of the thesis' chapter 5 without a mesh file.
//
// A right hand, lying flat: fingers, spread and slightly bent, point to -z, the palm faces -y, the thumb is at -x; it
// ends at a wrist. One closed skin without holes: the zero set of a smooth union of rounded bones and pads, meshed by
// constrained elastic surface nets (Gibson 1998) and smoothed along the surface.
#pragma once

#include <cstdint>

#include "haptic/sim/mesh.hpp"
#include "haptic/sim/tool_joints.hpp"

namespace haptic::sim {

/// Number of triangles, as in the thesis (section 5.5.1). Closed and welded, this mesh has 1,955 vertices; the thesis'
/// mesh, cut open at seams, has 3,919.
inline constexpr std::uint32_t kHandTriangles = 3906;

/// Number of spheres that represent it (thesis, section 5.5.1).
inline constexpr std::uint32_t kHandSpheres = 37;

/// Skin: closed, oriented outward, `length` (m) from the end of the wrist to the tip of the middle finger, origin in
/// the palm. Uses + - * / and sqrt only, so its bits are the same on every machine. Throws std::invalid_argument unless
/// the length is positive.
[[nodiscard]] TriangleMesh make_hand_mesh(double length);

/// Bones and joints of the same hand. At curl 1 it is a fist; at about 0.5 fingers and opposed thumb hold an object
/// about 5 cm thick (at a length of 0.19 m). Throws std::invalid_argument unless the length is positive.
[[nodiscard]] ToolSkeleton make_hand_skeleton(double length);

}  // namespace haptic::sim
