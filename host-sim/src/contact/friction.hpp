// Coulomb friction of a virtual proxy, with static and dynamic coefficients.
//
// Let x be the proxy, g its goal and x0 the nearest point to g outside the touched planes. The coupling pulls at the
// contact with k (g - x). Its part into the planes is g - x0 = -sum lambda_k n_k, its part along them x0 - x. A proxy
// that sticks keeps its position relative to the surface while
//     |x - x0| <= mu_s sum lambda_k,
// that is, while the goal is in the friction cone. Otherwise it slides toward x0 until |x - x0| = mu_d sum lambda_k,
// and mu_d applies until it comes to rest. The sum adds the magnitudes of all normal forces: in a groove it exceeds
// their resultant, and so does friction.
// @source Salisbury et al. 1995 (stiction point); Ruspini, Kolarov, Khatib 1997, section 5 (friction as a limit on the
// proxy's movement); Harwin, Melder 2002 (friction cone with two coefficients). Differs: several planes, weighted by
// their multipliers, and moving surfaces carry a sticking proxy.
#pragma once

#include <array>
#include <span>

#include "contact/contact_candidates.hpp"
#include "contact/proxy_path.hpp"
#include "contact/swept_tree.hpp"
#include "contact/virtual_proxy.hpp"
#include "haptic/sim/contact.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// Friction state of a proxy between two steps: its active planes and whether it slides. The planes carry a sticking
/// proxy in the next step.
struct FrictionState {
    SurfacePlanes active_planes;
    std::array<double, kMaxSurfacePlanes> share{};  // of each plane in the normal force, sum 1
    Vec3 anchor{0.0};                               // m, scene: where it sticks
    bool slides = false;
};

/// Input of one proxy for one step.
struct ProxyStep {
    Vec3 before{0.0};  // m, centre at the end of the last step
    Vec3 from{0.0};    // m, centre after the surfaces have moved: result of pop_out()
    Vec3 goal{0.0};    // m, device position
};

/// move_proxy() with settings.static_friction and settings.dynamic_friction. With both 0 it is move_proxy(), bit for
/// bit. The contacts of the result are the active planes at the final position. A sticking proxy moves with the
/// velocity of the touched points; it does not rotate. Every move is swept as in move_proxy(). Updates `state`.
[[nodiscard]] ProxyMove move_proxy(const NearSurfaces& surfaces, const ProxyStep& step, double radius, double dt,
                                   const ContactSettings& settings, FrictionState& state,
                                   ProxyPath* path = nullptr) noexcept;

using FrictionParts = std::array<Vec3, kMaxSurfacePlanes>;  // N, per contact

/// Divides the tangential part of a force among the contacts, in proportion to the normal forces `strength` (N), evenly
/// if these are 0. `force` and the result act on the proxy; the surfaces get the opposite.
[[nodiscard]] FrictionParts divide_friction(const Vec3& force, const SurfacePlanes& contacts,
                                            const std::array<double, kMaxSurfacePlanes>& strength) noexcept;

/// m/s: velocity at which the surfaces carry a sticking proxy, the average of the touched points weighted by `share`.
[[nodiscard]] Vec3 carrying_velocity(std::span<const MovingSurface> surfaces, const FrictionState& state,
                                     double dt) noexcept;

}  // namespace haptic::sim
