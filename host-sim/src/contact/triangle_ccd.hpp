// Half-CCD: continuous collision detection of a sphere at rest against one moving triangle, by conservative
// advancement.
//
// The distance d(t) from the sphere's centre to the triangle is Lipschitz: no point of the triangle moves faster than
// its fastest vertex, so |d(t + h) - d(t)| <= h * max |x_i(1) - x_i(0)|. Advancing t by (d - r) over that bound never
// passes the first contact, whatever feature is touched (Mirtich 1996). A second bound is usually much longer: with n
// the direction from the closest point to the centre, d(t) >= min_i dot(n, p - x_i(t)), and each of the three terms is
// linear in t. The longer of the two steps is taken.
#pragma once

#include <array>

#include "haptic/realtime.hpp"
#include "haptic/sim/closest_point.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// A triangle whose corners move linearly from start at t = 0 to end at t = 1.
struct MovingTriangle {
    TriangleCorners start;
    TriangleCorners end;
};

/// Corners at a time in [0, 1], m.
[[nodiscard]] TriangleCorners corners_at(const MovingTriangle& triangle, double time) HAPTIC_RT;

/// First contact of a sphere with a moving triangle.
struct TriangleTouch {
    bool touches = false;
    double time = 0.0;   // in [0, 1]; 0 if the sphere touches from the start
    ClosestPoint at;     // closest point of the triangle at that time; `point` relative to the sphere's centre
    int iterations = 0;  // distance evaluations
};

/// Relative tolerance. A contact is never missed and its time is never late. Where the bound on iterations is reached
/// the time may be early. A triangle that stays farther than radius * (1 + kCreepTolerance) is never reported.
inline constexpr double kCreepTolerance = 0.9e-4;

/// No release: every triangle within the radius counts as touching, also from the start.
inline constexpr double kNoRelease = 1e300;

/// First time in [0, limit] at which the triangle is within `radius` of `center`. All tolerances are relative to the
/// radius and the coordinates, so a query scaled by a power of two gives the same bits of time. With `release`, a
/// triangle that starts nearer than radius / release touches only once its distance falls to `release` times the
/// initial one. Work is bounded by kMaxIterations in the source. No allocation.
/// @source Mirtich 1996 (conservative advancement); solves what thesis equation 4.4 leaves without a direct solution
[[nodiscard]] TriangleTouch sphere_triangle_ccd(const Vec3& center, double radius, const MovingTriangle& triangle,
                                                double limit = 1.0, double release = kNoRelease) HAPTIC_RT;

/// First passage of a moving triangle through a point; time in [0, 1].
struct PointPassage {
    bool passes = false;
    double time = 0.0;
};

/// Finds the first passage of the triangle through a point. Complete: conservative advancement with a vanishing radius
/// also finds the passage of a triangle that slides in its own plane, where the coplanarity cubic (Provot 1997, thesis
/// equations 4.2 and 4.5) vanishes. The root of the cubic then refines the time to rounding.
[[nodiscard]] PointPassage point_passage(const Vec3& point, const MovingTriangle& triangle) HAPTIC_RT;

}  // namespace haptic::sim
