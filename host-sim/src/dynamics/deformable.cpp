#include "haptic/sim/deformable.hpp"

#include <cmath>
#include <glm/matrix.hpp>

#include "dynamics/rotation.hpp"

namespace haptic::sim {

Vec3 offset_at(const Motion& motion, double time_s) noexcept {
    // A repeated motion continues from its start; another one stays at its end.
    const double period = motion.times.back();
    if (motion.repeat && period > 0.0) {
        time_s -= period * std::floor(time_s / period);
    }
    if (time_s >= period) {
        return motion.offsets.back();
    }
    // Linear interpolation between the two key times around time_s.
    std::size_t next = 1;
    while (motion.times[next] <= time_s) {
        ++next;
    }
    const double fraction = (time_s - motion.times[next - 1]) / (motion.times[next] - motion.times[next - 1]);
    return motion.offsets[next - 1] + fraction * (motion.offsets[next] - motion.offsets[next - 1]);
}

void place(DeformableBody& body, const Placement& placement) {
    // Mesh and particles move rigidly: p -> x + R p.
    const Mat3 rotation = to_matrix(placement.orientation);
    const auto move = [&](Vec3& p) { p = placement.position + rotation * p; };
    for (Vec3& vertex : body.mesh.vertices) {
        move(vertex);
    }
    ParticleModel& model = body.particles;
    for (std::size_t i = 0; i < model.size(); ++i) {
        move(model.rest_position[i]);
        move(model.position[i]);
        // Orientations and velocities rotate; free particles also get the velocity of the placement.
        model.axes[i] = placement.orientation * model.axes[i];
        model.velocity[i] = rotation * model.velocity[i];
        model.angular_velocity[i] = rotation * model.angular_velocity[i];
        if (model.pinned[i] == 0) {
            model.velocity[i] += placement.velocity;
        }
    }
    for (ElasticElement& element : model.elasticity.elements) {
        for (Vec3& gradient : element.gradient) {
            gradient = rotation * gradient;
        }
        element.spread = rotation * element.spread * glm::transpose(rotation);
    }
    // Offsets of scripted motions are vectors: rotated, not moved.
    for (Motion& motion : body.motions) {
        for (Vec3& offset : motion.offsets) {
            offset = rotation * offset;
        }
    }
}

}  // namespace haptic::sim
