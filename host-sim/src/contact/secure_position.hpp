// Secure position: half-CCD of a sphere at rest against moving surfaces, the first half of a step (thesis 4.2.2).
//
// The proxy rests until the first moving surface touches it. From there it advances in straight pieces. Each piece
// leads to the position next to the moved contact point at which the sphere is clear of that surface at t = 1. The
// piece is swept against all surfaces, sphere and triangles both moving. If another surface stops it, the next target
// is the point nearest to the position next to the contact that lies in the half-spaces which all touching features
// will bound at t = 1. Every piece keeps a positive distance from every surface, so the centre changes side of none.
//
// If the half-spaces leave no room for the whole sphere, `overconstrained` is set and the largest radius that fits is
// used. If they leave no room even for the centre, `no_room` is set, and the fastest surface there is named: it has to
// stand still in this step, since around surfaces that all stand the proxy may stay where it is.
#pragma once

#include <cstdint>

#include "contact/contact_candidates.hpp"
#include "contact/proxy_path.hpp"
#include "haptic/sim/contact.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// Result of secure_position().
struct SecurePosition {
    Vec3 position{0.0};            // m, centre at t = 1; without room where it was at t = 0
    bool touched = false;          // a surface came within the radius
    double first_time = 1.0;       // in [0, 1], time of the first contact
    SurfacePoint first;            // point of the first contact
    Vec3 first_normal{0.0};        // unit, from the surface to the centre
    int advances = 0;              // pieces of the path, at most ContactSettings::max_advances
    bool overconstrained = false;  // at some point less room than the radius
    bool no_room = false;          // on no way: `in_the_way` would pass through it
    SurfacePoint in_the_way;
};

/// Computes the secure position of a sphere that rests at `center` while `surfaces` move through the step. Appends the
/// pieces to `path` if given. Deterministic, no allocation, no libm. With `settings.method` Thesis it runs Algorithm 1
/// instead (thesis_ccd.hpp).
/// @source thesis 4.2.2; differs: any number of contacts, and the move to the secure position is swept
[[nodiscard]] SecurePosition secure_position(const NearSurfaces& surfaces, const Vec3& center, double radius,
                                             const ContactSettings& settings, ProxyPath* path = nullptr) noexcept;

}  // namespace haptic::sim
