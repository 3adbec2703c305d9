// A virtual proxy that surfaces do not let slide freely.
//
// With x the proxy where it is held, g its goal and x0 the point nearest to g that the touched planes allow, the
// coupling pulls at the contact with k (g - x): g - x0 = -sum lambda_k n_k into the planes and x0 - x along them. A
// proxy that sticks stays where it was, in the frame of the surface, while
//     |x - x0| <= mu_s sum lambda_k
// that is, while the goal is in the friction cone; otherwise it slides toward x0 until |x - x0| = mu_d sum lambda_k,
// and mu_d counts until it has come to rest. The sum over planes is the sum of all normal forces: in a groove it is
// larger than their resultant, and so is friction.
// @source Salisbury et al. 1995 (a stiction point that is kept); Ruspini, Kolarov, Khatib 1997, section 5 (friction as
// a limit on the proxy's movement); Harwin, Melder 2002 (friction cone with two coefficients). Differs: several planes
// by their multipliers, and surfaces that move take a sticking proxy along.
#pragma once

#include <array>
#include <span>

#include <haptic/sim/contact.hpp>
#include "contact/proxy_path.hpp"
#include <haptic/sim/contact/surroundings.hpp>
#include "contact/swept_tree.hpp"
#include "contact/virtual_proxy.hpp"
#include <haptic/types.hpp>

namespace haptic::sim {

/// What held a proxy at the end of the last step: by that it is taken along in the next one.
struct ProxyGrip {
    SurfacePlanes held_by;
    std::array<double, kMaxSurfacePlanes> share{};  // of each plane in the normal force, sum 1
    bool slides = false;
};

struct ProxyStep {
    Vec3 before{0.0};  // m, of the proxy at the end of the last step
    Vec3 from{0.0};    // m, where this step's surfaces have left it: pop_out()
    Vec3 goal{0.0};    // m, the device
};

/// move_proxy() with settings.static_friction and settings.dynamic_friction; without either it is move_proxy(), to the
/// bit. The contacts of the result are the planes that hold the proxy where it sticks. A proxy that does not turn and
/// does not slip goes with the velocity of the touched points. Every move is swept as there. Updates `grip`.
[[nodiscard]] ProxyMove move_proxy(const NearSurfaces& surfaces, const ProxyStep& step, double radius, double dt,
                                   const ContactSettings& settings, ProxyGrip& grip,
                                   ProxyPath* path = nullptr) noexcept;

using FrictionParts = std::array<Vec3, kMaxSurfacePlanes>;  // N, per contact

/// The part of a force on the proxy that does not come from the normals, divided among the contacts as the normal
/// forces `strength` (N) are, evenly if there are none. `force` is that on the proxy, and so is the result; the
/// surfaces get the opposite.
[[nodiscard]] FrictionParts divide_friction(const Vec3& force, const SurfacePlanes& contacts,
                                            const std::array<double, kMaxSurfacePlanes>& strength) noexcept;

/// m/s, at which the surfaces take a proxy along that sticks to them: of the touched points, by their shares.
[[nodiscard]] Vec3 carrying_velocity(std::span<const MovingSurface> surfaces, const ProxyGrip& grip,
                                     double dt) noexcept;

}  // namespace haptic::sim
