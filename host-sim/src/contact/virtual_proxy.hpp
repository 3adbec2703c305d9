// The virtual proxy: a sphere that goes toward the device as far as the surfaces let it (thesis, 4.1.1).
#pragma once

#include <haptic/sim/contact.hpp>
#include "contact/proxy_path.hpp"
#include <haptic/sim/contact/surroundings.hpp>
#include <haptic/types.hpp>

namespace haptic::sim {

struct ProxyMove {
    Vec3 position{0.0};
    SurfacePlanes contacts;  // the planes that keep the proxy from the goal; none if it reached it
    int iterations = 0;
    bool converged = true;  // false: max_proxy_moves was met on the way; the next step goes on from here
};

/// Moves a sphere from `from` toward `goal` past the surfaces as they are at the end of the step. Each move is swept
/// with the shrunk radius, so that no surface is passed; at a contact the aim becomes the point nearest to the goal in
/// the half-spaces of everything that is touched there, until that point is reached. `dt` (s) turns displacements into
/// the velocities of the contact planes.
/// @source Ruspini, Kolarov, Khatib 1997; thesis 4.1.1 and 4.1.4. Differs: all touched planes enter the minimisation,
/// whose exact solution then names the (at most three) that hold.
[[nodiscard]] ProxyMove move_proxy(const NearSurfaces& surfaces, const Vec3& from, const Vec3& goal, double radius,
                                   double dt, const ContactSettings& settings, ProxyPath* path = nullptr) noexcept;

}  // namespace haptic::sim
