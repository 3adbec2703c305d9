// A rigid, frictionless sphere on a linearly elastic layer that is bonded to a rigid base: force over depth.
//
// All three take the sphere, of radius R, for a paraboloid and the depth d for small against R.
//
// Half-space (Hertz):  F = 4/3 E / (1 - nu^2) sqrt(R) d^(3/2).
//
// Layer of thickness h: in Hankel space, with wave number k, a pressure displaces the surface of the half-space by
// 2 (1 - nu^2) / E / k, that of the layer by M(k h) times as much,
//
//     M(u) = (K sinh 2u - 2u) / (K cosh 2u + 2u^2 + 5 - 12 nu + 8 nu^2),   K = 3 - 4 nu.
//
// With the transform of the pressure as integral of phi(t) cos(k t) over the contact, 0 <= t <= a, the displacement is
// that of the paraboloid there if
//
//     phi(t) = E / (pi (1 - nu^2)) (d - t^2 / R) + 2/pi int_0^a int_0^inf (1 - M(k h)) cos(k t) cos(k s) dk phi(s) ds,
//
// the pressure is bounded at the edge if phi(a) = 0, and F = 2 pi int phi. This is solved to 1e-6.
//
// Series: Hertz times 1 + c_1 x + ... + c_4 x^4, x = sqrt(R d) / h. It is 1 % below the solution at x = 0.22 and 3 %
// at 0.35 (nu = 0.45): its first term is right, the others are too small.
// @source H. Hertz, "Ueber die Beruehrung fester elastischer Koerper", 1881; N. N. Lebedev, Ya. S. Ufliand,
// "Axisymmetric contact problem for an elastic layer", 1958; E. K. Dimitriadis, F. Horkay, J. Maresca, B. Kachar, R. S.
// Chadwick, "Determination of elastic moduli of thin layers of soft material using the atomic force microscope", 2002.
// The general coefficients give c_4 = -0.0975 for nu = 0.5, where its equation 12 prints +0.0975; at x = 0.4 that is
// 0.3 % of F.
#pragma once

#include "haptic/sim/material.hpp"

namespace haptic::sim {

struct LayerContact {
    SolidMaterial material;
    double thickness = 0.05;  // m, h
    double radius = 0.2;      // m, R
};

/// N (Hertz 1881).
[[nodiscard]] double half_space_force(const LayerContact& contact, double depth) noexcept;
/// N (Dimitriadis et al. 2002).
[[nodiscard]] double layer_series_force(const LayerContact& contact, double depth) noexcept;
/// N, by the integral equation. For contacts up to the thickness in radius.
[[nodiscard]] double layer_force(const LayerContact& contact, double depth);

}  // namespace haptic::sim
