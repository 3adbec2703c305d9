// Friction at the haptic rate: Coulomb friction of a proxy particle on its planes, kept from tick to tick.
//
// Let x0 be the frictionless local proxy of a goal g, held by planes with normals n_k: x0 - g = sum lambda_k n_k. A
// particle sticks at its position x on the planes while |x - x0| <= mu_s sum lambda_k, that is, while the goal is in
// the friction cone. Beyond that it slides until |x - x0| = mu_d sum lambda_k, and mu_d applies until it has come to
// rest. A sticking particle moves with the surface. The simulation moves its own proxy by the same law, at its own
// rate.
// @source Harwin, Melder 2002 (friction cone); Ruspini, Kolarov, Khatib 1997, section 5
#pragma once

#include <span>

#include "haptic/realtime.hpp"
#include "haptic/types.hpp"
#include "rendering/local_proxy.hpp"

namespace haptic::rt {

struct FrictionState {
    Vec3 position{0.0, 0.0, 0.0};  // m, device frame, of the particle with friction; valid in contact only
    bool in_contact = false;       // sticking or sliding
    bool sliding = false;
};

/// Coulomb coefficients.
struct Friction {
    double mu_static = 0.0;
    double mu_dynamic = 0.0;
    [[nodiscard]] bool any() const HAPTIC_RT { return mu_static > 0.0 || mu_dynamic > 0.0; }
};

/// Updates the friction state for one tick and returns the offset x - x0 (m). Exactly zero without friction, and where
/// no plane holds the proxy. `surface_displacement` (m): movement of the surface since the last tick. A particle that
/// begins to touch sticks where it touched.
[[nodiscard]] Vec3 apply_friction(const LocalProxy& proxy, const Vec3& target, std::span<const HalfSpace> planes,
                                  const Friction& friction, const Vec3& surface_displacement,
                                  FrictionState& state) HAPTIC_RT;

}  // namespace haptic::rt
