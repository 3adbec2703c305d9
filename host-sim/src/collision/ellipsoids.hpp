// Ellipsoids around particles, and the separating plane of two of them within a step.
//
// An ellipsoid with semi-axes a along the columns of R has the shape matrix S = R diag(a^2) R^T. It contains the points
// x with x^T S^-1 x <= 1 and extends h(n) = sqrt(n^T S n) in the direction n (support function). A plane with unit
// normal n separates two ellipsoids with centre offset c if their gap along it, n.c - h1(n) - h2(n), is not negative.
// The gap along any n is at most the signed distance (negative: depth) and equals it for the best n. So keeping the gap
// positive along any n is safe; a bad n only keeps apart ellipsoids that do not touch.
//
// We take n from the ellipsoid M = (1 + p) S1 + (1 + 1/p) S2, which contains the Minkowski sum of the two for every p >
// 0. It is the Minkowski sum if both have the same shape and orientation and p is the ratio of their sizes. n is M^-1
// c, the normal of M where c intersects it. (Müller & Chentanez 2011 take the line of centres, which is right for
// spheres only.) For touching ellipsoids with random axes up to 3 : 1, the gap is too small by 0.1 % of the sum of mean
// semi-axes on average and by 2 % at worst.
// @source L. Ros, A. Sabater, F. Thomas, "An ellipsoidal calculus based on propagation and fusion", 2002 (the family of
// M); J. W. Perram, M. S. Wertheim, "Statistical mechanics of hard ellipsoids", 1985 (separation by the normals of M,
// with the best p)
#pragma once

#include "haptic/types.hpp"

namespace haptic::sim {

/// Symmetric shape matrix by its lower triangle, m^2.
struct EllipsoidShape {
    double xx = 0.0;
    double yy = 0.0;
    double zz = 0.0;
    double yx = 0.0;
    double zx = 0.0;
    double zy = 0.0;
};

/// Shape matrix of an ellipsoid with these semi-axes (m); `orientation` rotates its axes into the scene.
[[nodiscard]] EllipsoidShape shape_of(const Vec3& semi_axes, const Quat& orientation) noexcept;

/// Support function h(n) for a unit normal, m.
[[nodiscard]] double reach_of(const EllipsoidShape& shape, const Vec3& normal) noexcept;

/// Relative motion of two ellipsoids in a step: the second at the origin, the first on a straight path.
struct EllipsoidSweep {
    EllipsoidShape first;
    EllipsoidShape second;
    double size_ratio = 1.0;  // p: mean semi-axis of the second over that of the first, both positive
    Vec3 from{0.0};           // m
    Vec3 to{0.0};             // m
};

/// Unit normal of the separating plane, toward the first ellipsoid. It is the normal of M where the path first enters
/// M; if it does not, where it comes nearest; if it starts inside, at the start. The path up to that point lies
/// entirely on the outer side of the plane that touches M with this normal.
[[nodiscard]] Vec3 separating_normal(const EllipsoidSweep& sweep) noexcept;

}  // namespace haptic::sim
