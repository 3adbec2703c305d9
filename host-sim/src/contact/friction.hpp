// Coulomb friction of a virtual proxy, with static and dynamic coefficients.
//
// A proxy that touches a surface is anchored to it. It sticks while the tangential force that holds it at its anchor is
// at most mu_s times the sum of its normal forces, and moves with the surface, or rolls on it (tool_proxies.hpp).
// Otherwise it slides with mu_d times that sum until it comes to rest, and takes its anchor along. The sum adds the
// magnitudes of all normal forces: in a groove it exceeds their resultant, and so does friction. The forces are those
// of the contact problem (tool_proxies.hpp).
// @source Salisbury et al. 1995 (stiction point); Ruspini, Kolarov, Khatib 1997, section 5 (friction as a limit on the
// proxy's movement); Harwin, Melder 2002 (friction cone with two coefficients). Differs: several planes, weighted by
// their multipliers, and moving surfaces carry a sticking proxy.
#pragma once

#include <array>
#include <span>

#include "contact/swept_tree.hpp"
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

/// m/s: velocity at which the surfaces carry a sticking proxy, the average of the touched points weighted by `share`.
[[nodiscard]] Vec3 carrying_velocity(std::span<const MovingSurface> surfaces, const FrictionState& state,
                                     double dt) noexcept;

}  // namespace haptic::sim
