// Rotations without transcendental functions, so that results have the same bits on every machine.
#pragma once

#include "haptic/types.hpp"

namespace haptic::sim {

/// The rotation matrix of a unit quaternion.
[[nodiscard]] Mat3 to_matrix(const Quat& q) noexcept;

/// q rotated by the rotation vector `rotation`, rad, in the fixed frame, with the Cayley map: about the same axis, by
/// 2 atan(|rotation| / 2) instead of |rotation|. They differ by |rotation|^3 / 12. Any finite vector gives a unit
/// quaternion.
[[nodiscard]] Quat turned(const Quat& q, const Vec3& rotation) noexcept;

/// Rotation vector with which turned() takes `from` to `to`: its exact inverse, by the smaller angle.
[[nodiscard]] Vec3 rotation_between(const Quat& from, const Quat& to) noexcept;

/// Extracts the rotational part of a matrix with `iterations` steps from a guess.
///
/// A step is that of M. Müller, J. Bender, N. Chentanez, M. Macklin, "A Robust Method to Extract the Rotational Part of
/// Deformations", 2016, equation 7, with the Cayley map instead of the exponential (same fixed points and order).
/// Rotating about the torque sum r_i x a_i by its ratio to |tr(R^T A)| is then a power iteration, shifted by 2 |o| - o
/// with o = q^T K q, on the matrix K of B. K. P. Horn, "Closed-Form Solution of Absolute Orientation Using Unit
/// Quaternions", 1987, for which tr(R(q)^T A) = q^T K q; the torque is its gradient. The iteration is a descent: it
/// needs no decomposition, handles inverted and singular matrices, and stays near the guess where the matrix does not
/// determine the rotation. The result is always a proper rotation; the zero matrix gives the guess.
[[nodiscard]] Quat extract_rotation(const Mat3& matrix, const Quat& guess, int iterations) noexcept;

/// Diagonalises a symmetric matrix; the columns of `axes`, a rotation, become its eigenvectors (C. G. J. Jacobi, 1846).
/// `sweeps` converge quadratically: six suffice for doubles, four for floats.
void diagonalise(Mat3& m, Mat3& axes, int sweeps) noexcept;

/// a += scale * p q^T.
inline void add_outer(Mat3& a, double scale, const Vec3& p, const Vec3& q) noexcept {
    const Vec3 sp = scale * p;
    a[0] += sp * q.x;
    a[1] += sp * q.y;
    a[2] += sp * q.z;
}

/// Solves inertia * x = momentum, with the inertia tensor trace(S) 1 - S of the scatter matrix S = sum m p p^T. For
/// collinear or coincident points the tensor is singular; the undetermined part of x is then bounded and rotates no
/// point.
[[nodiscard]] Vec3 solve_inertia(const Mat3& scatter, const Vec3& momentum) noexcept;

}  // namespace haptic::sim
