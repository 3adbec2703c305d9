#include "contact/active_contacts.hpp"

#include <glm/geometric.hpp>

namespace haptic::sim {

void ActiveContacts::update(const NearSurfaces& surfaces, const Vec3& at, const Vec3& goal, double radius,
                            const ContactSettings& settings) noexcept {
    contact_set_.collect(surfaces, 1.0, at, contact_reach(radius, settings));
    planes_.clear();
    for (const ContactPoint& t : contact_set_.points()) {
        planes_.add(t.normal, glm::dot(t.normal, t.point));
    }
    // Half the clearance is a radius that always fits.
    fit_ = planes_.project_with_largest_radius(goal, radius, 0.5 * contact_set_.clearance(radius));
}

SurfacePlanes ActiveContacts::planes(const NearSurfaces& surfaces, double dt) const noexcept {
    SurfacePlanes planes;
    for (std::uint32_t k = 0; k < fit_.projection.active_count; ++k) {
        const ContactPoint& t = contact_set_.points()[fit_.projection.active[k]];
        // Plane through the contact point, offset by the fitted radius, with the velocity of the surface along the
        // normal.
        SurfacePlane& plane = planes.plane[planes.count++];
        plane.normal = t.normal;
        plane.offset = glm::dot(t.normal, t.point) + fit_.radius;
        plane.velocity = glm::dot(t.normal, displacement_of(surfaces[t.object].motion, t.triangle, t.at.weights)) / dt;
        plane.touched = surface_point(t);
    }
    return planes;
}

}  // namespace haptic::sim
