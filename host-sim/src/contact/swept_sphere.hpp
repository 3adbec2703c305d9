// Moving sphere against a triangle at rest: sweep against the configuration-space obstacle, in closed form.
#pragma once

#include "haptic/realtime.hpp"
#include "haptic/sim/closest_point.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// First contact of a swept sphere.
struct SphereHit {
    bool hits = false;
    double fraction = 1.0;  // of the displacement, in [0, 1]
};

/// First fraction of `displacement` at which a sphere from `from` comes within `radius` of the triangle. The centre is
/// intersected with the C-obstacle: faces offset by the radius, cylinders around the edges, spheres around the
/// vertices. `distance` is the distance from `from` to the triangle. A sphere that starts within the radius hits at 0
/// if it approaches the closest point, and not at all otherwise. No allocation, no libm except sqrt.
/// @source Ruspini, Kolarov, Khatib 1997, section 3 (C-obstacles)
[[nodiscard]] SphereHit sweep_sphere(const Vec3& from, const Vec3& displacement, double radius, double distance,
                                     const TriangleCorners& triangle) HAPTIC_RT;

}  // namespace haptic::sim
