// A moving sphere against a triangle that stands still: the configuration-space obstacle in closed form.
#pragma once

#include <haptic/realtime.hpp>
#include <haptic/sim/closest_point.hpp>
#include <haptic/types.hpp>

namespace haptic::sim {

struct SphereHit {
    bool hits = false;
    double fraction = 1.0;  // of the displacement, in [0, 1]
};

/// First fraction of `displacement` at which a sphere that starts at `from` is within `radius` of the triangle: the
/// centre against the faces offset by the radius, the cylinders about the edges and the spheres about the corners.
/// `distance` is that of `from` to the triangle. A sphere that is within the radius already hits at 0 if it comes
/// nearer, and not at all if it goes away.
/// @source Ruspini, Kolarov, Khatib 1997, section 3 (C-obstacles)
[[nodiscard]] SphereHit sweep_sphere(const Vec3& from, const Vec3& displacement, double radius, double distance,
                                     const TriangleCorners& triangle) HAPTIC_RT;

}  // namespace haptic::sim
