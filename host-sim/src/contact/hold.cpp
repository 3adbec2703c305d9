#include "contact/hold.hpp"

#include <glm/geometric.hpp>

namespace haptic::sim {

void Hold::look(const NearSurfaces& surfaces, const Vec3& at, const Vec3& goal, double radius,
                const ContactSettings& settings) noexcept {
    touching_.gather(surfaces, 1.0, at, touching_reach(radius, settings), nullptr);
    planes_.clear();
    for (const Touching& t : touching_.points()) {
        planes_.add(t.normal, glm::dot(t.normal, t.point));
    }
    room_ = planes_.project_with_room(goal, radius, 0.5 * touching_.clearance(radius));
}

SurfacePlanes Hold::planes(const NearSurfaces& surfaces, double dt) const noexcept {
    SurfacePlanes planes;
    for (std::uint32_t k = 0; k < room_.at.active_count; ++k) {
        const Touching& t = touching_.points()[room_.at.active[k]];
        SurfacePlane& plane = planes.plane[planes.count++];
        plane.normal = t.normal;
        plane.offset = glm::dot(t.normal, t.point) + room_.radius;
        plane.velocity = glm::dot(t.normal, displacement_of(surfaces[t.object].motion, t.triangle, t.at.weights)) / dt;
        plane.touched = surface_point(t);
    }
    return planes;
}

}  // namespace haptic::sim
