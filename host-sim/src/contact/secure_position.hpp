// Where a proxy is safe after all surfaces have moved: the first half of a step (thesis, 4.2.2).
//
// The proxy stands while the surfaces move, until the first of them touches it. From there it rides with the touched
// point, straight to the place beside the moved surface where it is clear of it at t = 1; that ride is swept against
// everything, and where something else touches on the way, the next ride is clear of all that touch then: the place
// nearest to the ride's aim in the half-spaces that the touching features will bound at t = 1. Each ride keeps a
// positive distance from every surface, so the centre changes side of none.
//
// Where the half-spaces leave no room for the whole sphere, `squeezed` is set and the proxy makes do with the largest
// radius for which there is room. Where they leave no room even for its centre (surfaces that pass through one another
// right there), the fastest of them is let through and named: the anvil holds, the hammer passes.
#pragma once

#include <cstdint>

#include <haptic/sim/contact.hpp>
#include "contact/proxy_path.hpp"
#include <haptic/sim/contact/surroundings.hpp>
#include <haptic/types.hpp>

namespace haptic::sim {

struct SecurePosition {
    Vec3 position{0.0};       // m, of the centre at t = 1
    bool touched = false;     // something came within the radius
    double first_time = 1.0;  // in [0, 1], when
    SurfacePoint first;       // what
    Vec3 first_normal{0.0};   // unit, from the surface to the centre
    int rides = 0;
    bool squeezed = false;     // less room than the radius on the way
    bool let_through = false;  // no room for the centre: `passed` went through it
    SurfacePoint passed;
};

/// The secure position of a sphere that stands at `center` while `surfaces` move. Appends the ride to `path` if given.
/// Deterministic, no allocation, no libm. With `settings.method` Thesis it is Algorithm 1 instead (thesis_ccd.hpp).
[[nodiscard]] SecurePosition secure_position(const NearSurfaces& surfaces, const Vec3& center, double radius,
                                             const ContactSettings& settings, ProxyPath* path = nullptr) noexcept;

}  // namespace haptic::sim
