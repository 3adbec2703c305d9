// Virtual proxy: a sphere that follows the device as closely as the surfaces allow (thesis 4.1.1).
#pragma once

#include "contact/contact_candidates.hpp"
#include "contact/proxy_path.hpp"
#include "haptic/sim/contact.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// Result of move_proxy().
struct ProxyMove {
    Vec3 position{0.0};      // m, centre of the proxy
    SurfacePlanes contacts;  // active planes between proxy and goal; none if it reached the goal
    int iterations = 0;      // moves made
    bool converged = true;   // false: max_proxy_moves was reached; the next step continues from here
};

/// Moves a sphere from `from` toward `goal` among the surfaces at the end of the step. Each move is swept with the
/// shrunk radius, so that no surface is passed. At a contact the target becomes the point nearest to the goal in the
/// half-spaces of all touched features, until that point is reached. `dt` (s) turns displacements into velocities of
/// the contact planes. No allocation; at most settings.max_proxy_moves moves.
/// @source Ruspini, Kolarov, Khatib 1997; thesis 4.1.1 and 4.1.4. Differs: all touched planes enter the minimisation,
/// whose exact solution identifies the active ones (at most three).
[[nodiscard]] ProxyMove move_proxy(const NearSurfaces& surfaces, const Vec3& from, const Vec3& goal, double radius,
                                   double dt, const ContactSettings& settings, ProxyPath* path = nullptr) noexcept;

}  // namespace haptic::sim
