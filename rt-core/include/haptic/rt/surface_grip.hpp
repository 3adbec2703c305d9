// Friction at the haptic rate: where a proxy particle sticks to its planes, kept from tick to tick.
//
// With x0 the frictionless local proxy of a goal g, held by planes with normals n_k, x0 - g = sum lambda_k n_k, a
// particle stays at its place x on the planes while |x - x0| <= mu_s sum lambda_k, that is, while the goal is in the
// friction cone. Beyond it slides until |x - x0| = mu_d sum lambda_k, and mu_d counts until it has come to rest. This
// is the law by which the simulation moves its own proxy, at the rate of the hand. What sticks goes with the surface's
// velocity.
// @source Harwin, Melder 2002 (friction cone); Ruspini, Kolarov, Khatib 1997, section 5
#pragma once

#include <span>

#include "haptic/realtime.hpp"
#include "rendering/local_proxy.hpp"
#include "haptic/types.hpp"

namespace haptic::rt {

struct SurfaceGrip {
    Vec3 at{0.0, 0.0, 0.0};  // m, device frame
    bool held = false;       // else `at` says nothing
    bool slides = false;
};

struct Friction {
    double at_rest = 0.0;  // coefficient mu_s
    double sliding = 0.0;  // mu_d
    [[nodiscard]] bool any() const HAPTIC_RT { return at_rest > 0.0 || sliding > 0.0; }
};

/// x - x0 (m), exactly zero without friction and where no plane holds the proxy, and the grip as it is after this tick.
/// `carried` (m) is how far the surface went since the last tick. A particle that touches sticks first where it
/// touched.
[[nodiscard]] Vec3 hold(const LocalProxy& proxy, const Vec3& target, std::span<const HalfSpace> planes,
                        const Friction& friction, const Vec3& carried, SurfaceGrip& grip) HAPTIC_RT;

}  // namespace haptic::rt
