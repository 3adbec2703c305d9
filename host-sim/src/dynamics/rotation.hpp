// Rotations without transcendental functions, so that the last bit is the same on every machine.
#pragma once

#include <haptic/types.hpp>

namespace haptic::sim {

/// The rotation matrix of a unit quaternion.
[[nodiscard]] Mat3 to_matrix(const Quat& q) noexcept;

/// q turned by the rotation vector `turn` (rad, fixed frame) by way of the Cayley map: about the same axis, by
/// 2 atan(|turn| / 2) instead of |turn|. The two differ by |turn|^3 / 12. Any finite vector gives a unit quaternion.
[[nodiscard]] Quat turned(const Quat& q, const Vec3& turn) noexcept;

/// The rotation vector that turned() needs to take `from` to `to`: its exact inverse, along the shorter way.
[[nodiscard]] Vec3 turn_between(const Quat& from, const Quat& to) noexcept;

/// The rotational part of a matrix, by `iterations` steps from a guess.
///
/// The step is that of M. Müller, J. Bender, N. Chentanez, M. Macklin, "A Robust Method to Extract the Rotational Part
/// of Deformations", 2016, equation 7, with the Cayley map in place of the exponential (same fixed points, same order).
/// The turn about the torque sum r_i x a_i by its ratio to |tr(R^T A)| is then a step of the power iteration, shifted
/// by 2 |o| - o with o = q^T K q, on the matrix K of B. K. P. Horn, "Closed-Form Solution of Absolute Orientation Using
/// Unit Quaternions", 1987, for which tr(R(q)^T A) = q^T K q: K q is the gradient that the torque is taken from. It is
/// a descent: it needs no decomposition, copes with inverted and singular matrices, and where the matrix leaves the
/// rotation undetermined it stays near the guess. Always a proper rotation; the zero matrix gives the guess.
[[nodiscard]] Quat extract_rotation(const Mat3& matrix, const Quat& guess, int iterations) noexcept;

/// Solves inertia * x = momentum for an inertia tensor given through the scatter matrix S = sum m p p^T, inertia =
/// trace(S) 1 - S. Where the points are collinear, or all in one place, the tensor is singular; the undetermined part
/// of x is then bounded and turns nothing.
[[nodiscard]] Vec3 solve_inertia(const Mat3& scatter, const Vec3& momentum) noexcept;

}  // namespace haptic::sim
