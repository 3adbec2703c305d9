#include "contact/pop_out.hpp"

#include <cmath>
#include <glm/geometric.hpp>

#include "contact/touching.hpp"
#include "contact/thesis/thesis_pop_out.hpp"

namespace haptic::sim {

namespace {

// On its way out the sphere may come nearer to a triangle that is not in its way yet, but not by more than this share
// of its distance: the centre stays on its side.
constexpr double kRelease = 0.5;

}  // namespace

PopOut pop_out(const NearSurfaces& surfaces, const Vec3& center, double radius, const ContactSettings& settings,
               ProxyPath* path) noexcept {
    if (settings.pop_out == PopOutMethod::Thesis) {
        return thesis_pop_out(surfaces.all(), center, radius, settings, path);
    }
    // Half-way between found and placed: clear enough not to be popped again, and reached in spite of rounding.
    const double enough = radius * 0.5 * (1.0 + settings.shrink);
    PopOut result;
    result.position = center;
    TouchingSet touching;
    for (;; ++result.iterations) {
        touching.gather(surfaces, 1.0, result.position, touching_reach(radius, settings), nullptr);
        result.clearance = touching.clearance(radius);
        if (result.clearance >= enough || result.iterations >= settings.max_pop_outs) {
            break;
        }
        PlaneSet planes;
        for (const Touching& t : touching.points()) {
            planes.add(t.normal, glm::dot(t.normal, t.point));
        }
        const PlaneSet::Room room = planes.project_with_room(result.position, radius, 0.5 * result.clearance);
        if (!room.any) {
            break;
        }
        Vec3 move = room.at.point - result.position;
        const double length = std::sqrt(glm::dot(move, move));
        if (length <= kArrived * radius) {
            break;  // as clear as it gets
        }
        if (length > radius) {
            move *= radius / length;  // planes speak for the neighbourhood of their points only
        }
        move *= free_fraction(surfaces, result.position, move, room.radius * settings.shrink, kRelease);
        result.position += move;
        if (path != nullptr) {
            path->append(1.0, result.position);
        }
    }
    result.squeezed = result.clearance < radius * settings.shrink;
    return result;
}

}  // namespace haptic::sim
