#include "haptic/sim/contact/virtual_proxy.hpp"

#include <cmath>
#include <glm/geometric.hpp>

#include "contact/touching.hpp"

namespace haptic::sim {

namespace {

constexpr double kArrived = 1e-6;  // of the radius: an aim this near is reached

SurfacePlanes planes_of(std::span<const MovingSurface> surfaces, std::span<const Touching> touching,
                        const Projection& held, double radius, double dt) noexcept {
    SurfacePlanes planes;
    for (std::uint32_t k = 0; k < held.active_count; ++k) {
        const Touching& t = touching[held.active[k]];
        SurfacePlane& plane = planes.plane[planes.count++];
        plane.normal = t.normal;
        plane.offset = glm::dot(t.normal, t.point) + radius;
        plane.velocity = glm::dot(t.normal, displacement_of(surfaces[t.object].motion, t.triangle, t.at.weights)) / dt;
        plane.touched = surface_point(t);
    }
    return planes;
}

}  // namespace

ProxyMove move_proxy(std::span<const MovingSurface> surfaces, const Vec3& from, const Vec3& goal, double radius,
                     double dt, const ContactSettings& settings, ProxyPath* path) noexcept {
    ProxyMove result;
    result.position = from;
    TouchingSet touching;
    for (;; ++result.iterations) {
        touching.gather(surfaces, 1.0, result.position, radius * (1.0 + kTouchBand), nullptr);
        PlaneSet planes;
        for (const Touching& t : touching.points()) {
            planes.add(t.normal, glm::dot(t.normal, t.point));
        }
        const double clearance = touching.clearance(radius);
        const PlaneSet::Room room = planes.project_with_room(goal, radius, 0.5 * clearance);
        const Vec3 move = room.any ? room.at.point - result.position : Vec3(0.0);
        const bool arrived = glm::dot(move, move) <= kArrived * kArrived * radius * radius;
        if (arrived || result.iterations >= settings.max_proxy_moves) {
            result.converged = arrived;
            result.contacts = planes_of(surfaces, touching.points(), room.at, radius, dt);
            return result;
        }
        result.position +=
            move * free_fraction(surfaces, result.position, move, radius * settings.shrink, settings.shrink);
        if (path != nullptr) {
            path->append(1.0, result.position);
        }
    }
}

}  // namespace haptic::sim
