#include "contact/friction.hpp"

#include "contact/contact_points.hpp"

namespace haptic::sim {

Vec3 carrying_velocity(std::span<const MovingSurface> surfaces, const FrictionState& state, double dt) noexcept {
    Vec3 velocity(0.0);
    for (std::size_t k = 0; k < state.active_planes.count; ++k) {
        const SurfacePoint& touched = state.active_planes.plane[k].touched;
        velocity +=
            displacement_of(surfaces[touched.object].motion, touched.triangle, touched.weights) * (state.share[k] / dt);
    }
    return velocity;
}

}  // namespace haptic::sim
