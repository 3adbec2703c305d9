// Solids of revolution: sphere, rod and probe meshes.
//
// Closed, outward oriented surfaces about the z axis with 32 points around. Round parts are inscribed: edges lie up to
// 0.5 % of the radius inside. They use + - * / and sqrt only, so their bits are the same on every machine.
#pragma once

#include "haptic/sim/mesh.hpp"

namespace haptic::sim {

/// A sphere about the origin. Throws std::invalid_argument unless the radius is positive.
[[nodiscard]] TriangleMesh make_sphere_mesh(double radius);

/// A capsule from z = -length / 2 to length / 2, m. Throws std::invalid_argument unless length / thickness is between 1
/// and 200.
[[nodiscard]] TriangleMesh make_rod_mesh(double length, double thickness);

/// A rod with a ball at its -z end, m; `length` includes the ball. Throws std::invalid_argument unless the ball is
/// thicker than the shaft and the length exceeds ball and shaft end.
[[nodiscard]] TriangleMesh make_probe_mesh(double length, double thickness, double ball_radius);

}  // namespace haptic::sim
