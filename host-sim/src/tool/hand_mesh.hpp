// A hand, generated: the tool of the thesis' chapter 5 without a mesh file.
//
// A right hand, lying flat: the fingers, spread and a little bent, point to -z, the palm looks to -y, the thumb is at
// -x; it ends in a wrist. One closed skin without holes: the surface where a smooth union of rounded bones and pads is
// zero, netted with cubes (Gibson 1998, Constrained Elastic Surface Nets) and evened out along the surface.
#pragma once

#include <cstdint>

#include <haptic/sim/mesh.hpp>
#include <haptic/sim/tool_joints.hpp>

namespace haptic::sim {

/// As many as the hand of the thesis has (section 5.5.1). Closed and welded, it has 1,955 vertices; that of the thesis,
/// cut open at seams, has 3,919.
inline constexpr std::uint32_t kHandTriangles = 3906;

/// Spheres that stand for it (thesis, section 5.5.1).
inline constexpr std::uint32_t kHandSpheres = 37;

/// The skin: closed, outward oriented, `length` long (m) from the end of the wrist to the tip of the middle finger, the
/// origin in the palm. Made with + - * / and sqrt only, so that its bits are the same on every machine. Throws
/// std::invalid_argument unless the length is positive.
[[nodiscard]] TriangleMesh make_hand_mesh(double length);

/// The bones of the same hand, and the joints by which it closes: at curl 1 it is a fist, about half way it holds what
/// is some 5 cm thick (at a length of 0.19 m) between fingers and thumb, which is opposed to them. Throws
/// std::invalid_argument unless the length is positive.
[[nodiscard]] ToolSkeleton make_hand_skeleton(double length);

}  // namespace haptic::sim
