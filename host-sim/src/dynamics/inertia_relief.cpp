#include "dynamics/inertia_relief.hpp"

#include "dynamics/model_bodies.hpp"
#include "dynamics/rotation.hpp"

namespace haptic::sim {

void InertiaRelief::place(const ParticleModel& start, const ParticleRange& body, std::span<Row> heavy) noexcept {
    centre_ = centre_of_mass(start, body);
    Mat3 scatter(0.0);
    for (std::uint32_t i = body.begin; i < body.end; ++i) {
        const Vec3 r = arm(start.position[i]);
        add_outer(scatter, start.mass[i], r, r);
        heavy[i - body.begin] = row_of(start.mass[i] * r);
    }
    for (int c = 0; c < 3; ++c) {
        Vec3 axis(0.0);
        axis[c] = 1.0;
        inverse_inertia_[c] = solve_inertia(scatter, axis);
    }
}

void InertiaRelief::take_answers(const ParticleModel& start, const ParticleRange& body,
                                 std::span<const Row> answers) noexcept {
    Mat3 product(0.0);
    for (std::uint32_t i = body.begin; i < body.end; ++i) {
        add_outer(product, start.mass[i], arm(start.position[i]), vector_of(answers[i - body.begin]));
    }
    turning_ = Mat3(product[0][0] + product[1][1] + product[2][2]) - product;
}

}  // namespace haptic::sim
