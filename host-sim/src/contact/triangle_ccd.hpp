// Continuous collision detection of a standing sphere against one moving triangle.
//
// The distance d(t) from the sphere's centre to the triangle is Lipschitz: no point of the triangle moves faster than
// its fastest vertex, so |d(t + h) - d(t)| <= h * max |x_i(1) - x_i(0)|. Advancing t by (d - r) over that bound
// therefore never passes the first touch, whatever feature is touched (conservative advancement, Mirtich 1996). A
// second bound is usually far longer: with n the direction from the nearest point to the centre,
// d(t) >= min_i dot(n, p - x_i(t)), and each of the three is linear in t. The longer of both steps is taken.
#pragma once

#include <array>

#include <haptic/realtime.hpp>
#include <haptic/sim/closest_point.hpp>
#include <haptic/types.hpp>

namespace haptic::sim {

/// A triangle whose corners move linearly from start at t = 0 to end at t = 1.
struct MovingTriangle {
    TriangleCorners start;
    TriangleCorners end;
};

[[nodiscard]] TriangleCorners corners_at(const MovingTriangle& triangle, double time) HAPTIC_RT;

/// The first touch of a sphere, if there is one.
struct TriangleTouch {
    bool touches = false;
    double time = 0.0;   // in [0, 1]; 0 where the sphere touches from the start
    ClosestPoint at;     // nearest point of the triangle at that time; `point` relative to the sphere's centre
    int iterations = 0;  // distance evaluations
};

/// A touch is never missed and its time is never late; where the work bound is met it may be early, and a triangle that
/// comes no nearer than radius * (1 + kCreepTolerance) is never reported.
inline constexpr double kCreepTolerance = 0.9e-4;

/// Every triangle within the radius touches, also one that was there from the start.
inline constexpr double kNoRelease = 1e300;

/// First time in [0, limit] at which the triangle is within `radius` of `center`. All tolerances are relative to the
/// radius and the coordinates, so a query scaled by any power of two has the same bits of time. With `release`, a
/// triangle that is nearer from the start touches only once it has come nearer than `release` times that distance.
/// Work: see kMaxAdvances in the source.
[[nodiscard]] TriangleTouch sphere_triangle_ccd(const Vec3& center, double radius, const MovingTriangle& triangle,
                                                double limit = 1.0, double release = kNoRelease) HAPTIC_RT;

/// Whether, and when first in [0, 1], the triangle passes through a point.
struct PointPassage {
    bool passes = false;
    double time = 0.0;
};

/// Complete: an advancement with a vanishing radius finds the passage also where the triangle slides in its own plane
/// and the coplanarity cubic (Provot 1997) vanishes; the cubic's root then gives the time to rounding.
[[nodiscard]] PointPassage point_passage(const Vec3& point, const MovingTriangle& triangle) HAPTIC_RT;

}  // namespace haptic::sim
