// Solids of revolution, generated: sphere, rod and probe.
//
// Closed skins about the z axis, outward oriented, 32 points around. What is round is inscribed: edges lie up to 0.5 %
// of the radius inside. Made with + - * / and sqrt only, so that their bits are the same on every machine.
#pragma once

#include <haptic/sim/mesh.hpp>

namespace haptic::sim {

/// A sphere about the origin. Throws std::invalid_argument unless the radius is positive.
[[nodiscard]] TriangleMesh make_sphere_mesh(double radius);

/// A round bar with hemispheres at its ends, m: from z = -length / 2 to length / 2. Throws std::invalid_argument unless
/// it is longer than thick, 200 times at most.
[[nodiscard]] TriangleMesh make_rod_mesh(double length, double thickness);

/// A rod with a ball at its end at -z, m; `length` is that of the whole. Throws std::invalid_argument unless the ball
/// is thicker than the shaft and the whole longer than the ball and the shaft's end.
[[nodiscard]] TriangleMesh make_probe_mesh(double length, double thickness, double ball_radius);

}  // namespace haptic::sim
