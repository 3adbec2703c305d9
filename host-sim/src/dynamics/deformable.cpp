#include "haptic/sim/deformable.hpp"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "dynamics/rotation.hpp"

namespace haptic::sim {

namespace {

/// A function of time that is linear between its values. Times increase from 0.
template <class Value>
Value course_at(const std::vector<double>& times, const std::vector<Value>& values, bool repeat,
                double time_s) noexcept {
    // A repeated course continues from its start; another one stays at its end.
    const double period = times.back();
    if (repeat && period > 0.0) {
        time_s -= period * std::floor(time_s / period);
    }
    if (time_s >= period) {
        return values.back();
    }
    // Linear interpolation between the two key times around time_s.
    std::size_t next = 1;
    while (times[next] <= time_s) {
        ++next;
    }
    const double fraction = (time_s - times[next - 1]) / (times[next] - times[next - 1]);
    return values[next - 1] + fraction * (values[next] - values[next - 1]);
}

}  // namespace

Vec3 offset_at(const Motion& motion, double time_s) noexcept {
    return course_at(motion.times, motion.offsets, motion.repeat, time_s);
}

double factor_at(const Load& load, double time_s) noexcept {
    return load.times.empty() ? 1.0 : course_at(load.times, load.factors, load.repeat, time_s);
}

void add_forces(Load& load, double time_s, std::span<const Vec3> position, std::span<Vec3> force) noexcept {
    const double factor = factor_at(load, time_s);
    // F_i = w_i F
    for (const ParticleWeight& share : load.shares) {
        force[share.particle] += factor * share.weight * load.force;
    }
    // y_j = sum of w_ji x_i
    PressedSurface& surface = load.surface;
    for (std::size_t j = 0; j < surface.vertices.size(); ++j) {
        Vec3 at(0.0);
        for (const ParticleWeight& carrier : surface.vertices[j]) {
            at += carrier.weight * position[carrier.particle];
        }
        surface.position[j] = at;
        surface.force[j] = Vec3(0.0);
    }
    // f_j = -p A n / 3 of each triangle, with A n = (b - a) x (c - a) / 2
    for (const auto& [a, b, c] : surface.triangles) {
        const Vec3& at = surface.position[a];
        const Vec3 area = 0.5 * glm::cross(surface.position[b] - at, surface.position[c] - at);
        const Vec3 at_corner = -factor * load.pressure / 3.0 * area;
        surface.force[a] += at_corner;
        surface.force[b] += at_corner;
        surface.force[c] += at_corner;
    }
    // F_i = sum of w_ji f_j
    for (std::size_t j = 0; j < surface.vertices.size(); ++j) {
        for (const ParticleWeight& carrier : surface.vertices[j]) {
            force[carrier.particle] += carrier.weight * surface.force[j];
        }
    }
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
