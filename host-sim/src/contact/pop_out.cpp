#include "contact/pop_out.hpp"

#include <cmath>
#include <glm/geometric.hpp>

#include "contact/contact_points.hpp"
#include "contact/thesis/thesis_pop_out.hpp"

namespace haptic::sim {

namespace {

// Share of its present distance to which a triangle may come during a move. The sphere can then move past other
// triangles that clip it, and the centre still stays on its side.
constexpr double kRelease = 0.5;

}  // namespace

PopOut pop_out(const NearSurfaces& surfaces, const Vec3& center, double radius, const ContactSettings& settings,
               ProxyPath* path) noexcept {
    // Algorithm 2 as printed, for comparison.
    if (settings.pop_out == PopOutMethod::Thesis) {
        return thesis_pop_out(surfaces.all(), center, radius, settings, path);
    }
    // Free air: clear without a query.
    const double reach = contact_reach(radius, settings);
    if (surfaces.is_clear(aabb_of_segment(center, center, reach))) {
        return {.position = center, .clearance = radius};
    }
    // Half-way between the shrunk and the full radius: clear enough not to be popped out again, and reachable in spite
    // of rounding.
    const double min_clearance = radius * 0.5 * (1.0 + settings.shrink);
    PopOut result;
    result.position = center;
    ContactPointSet contacts;
    for (;; ++result.iterations) {
        // Stop once clear.
        contacts.collect(surfaces, 1.0, result.position, reach);
        result.clearance = contacts.clearance(radius);
        if (result.clearance >= min_clearance || result.iterations >= settings.max_pop_outs) {
            break;
        }
        // One half-space per contact point; nearest point outside all of them, with the largest radius that fits.
        PlaneSet planes;
        for (const ContactPoint& t : contacts.points()) {
            planes.add(t.normal, glm::dot(t.normal, t.point));
        }
        const PlaneSet::Fit fit = planes.project_with_largest_radius(result.position, radius, 0.5 * result.clearance);
        // The half-spaces leave no room even at half of the present clearance.
        if (!fit.feasible) {
            break;
        }
        // Move toward that point, by a radius at most.
        Vec3 move = fit.projection.point - result.position;
        const double length = std::sqrt(glm::dot(move, move));
        if (length <= kMinMove * radius) {
            break;  // as clear as possible
        }
        if (length > radius) {
            move *= radius / length;  // a plane represents its triangle only near the contact point
        }
        // Sweep the move.
        move *= free_fraction(surfaces, result.position, move, fit.radius * settings.shrink, kRelease);
        result.position += move;
        if (path != nullptr) {
            path->append(1.0, result.position);
        }
    }
    // Still nearer than the shrunk radius: the proxy has no room.
    result.overconstrained = result.clearance < radius * settings.shrink;
    return result;
}

}  // namespace haptic::sim
