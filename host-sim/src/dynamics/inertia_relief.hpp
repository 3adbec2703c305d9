// How a free elastic body turns with a force within a sub-step of length h: inertia relief.
//
// A force p at a point of a body moves all particles of it. Without its turning that is A^-1 p (elastic_bodies.hpp),
// which A resists as if turning were a strain. A free body is therefore relieved of the torque: the rigid rotation
// alpha = I^-1 (r x p), h^2 alpha in the sub-step, is added to the answer A^-1 to what is left of the force, p - m
// (alpha x r), and the turning of that answer, beta, is taken out again (r about the centre of mass). The answer then
// has the momenta of the force, and is symmetric: what j moves by a force at i is what i moves by the same force at j.
// With Q = A^-1 M r of the three coordinates:
//
//     u_j = (A^-1 p)_j - alpha x Q_j + gamma x r_j,   gamma = h^2 alpha - beta,   beta = I^-1 (Q x p - J alpha),
//     J = sum m ((Q . r) 1 - r Q^T)
//
// where r and Q without an index are those of the point, a mean of particles as p is their force.
// @source Inertia relief: the D'Alembert forces of a free body's rigid acceleration, as in structural analysis.
#pragma once

#include <glm/geometric.hpp>
#include <span>

#include "dynamics/rows.hpp"
#include "haptic/sim/particles.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// Of one body in one sub-step.
class InertiaRelief {
  public:
    /// Takes the body where it begins the sub-step. Writes m r, kg m, the forces whose answers are Q: one row per
    /// particle of the body.
    void place(const ParticleModel& start, const ParticleRange& body, std::span<Row> heavy) noexcept;
    /// Takes Q, s^2 m: one row per particle of the body.
    void take_answers(const ParticleModel& start, const ParticleRange& body, std::span<const Row> answers) noexcept;

    /// m, r.
    [[nodiscard]] Vec3 arm(const Vec3& position) const noexcept { return position - centre_; }
    [[nodiscard]] const Mat3& inverse_inertia() const noexcept { return inverse_inertia_; }
    /// J, kg m^2 s^2.
    [[nodiscard]] const Mat3& turning() const noexcept { return turning_; }

    /// What forces turn.
    struct Turn {
        Vec3 alpha{0.0};  // rad/s^2
        Vec3 gamma{0.0};  // rad
        void operator+=(const Turn& other) noexcept {
            alpha += other.alpha;
            gamma += other.gamma;
        }
    };
    /// By r x p, N m, and Q x p, N m s^2, of a force.
    [[nodiscard]] Turn turn_by(const Vec3& torque, const Vec3& answered, double h) const noexcept {
        const Vec3 alpha = inverse_inertia_ * torque;
        return {alpha, h * h * alpha - inverse_inertia_ * (answered - turning_ * alpha)};
    }
    /// m, of a particle.
    [[nodiscard]] static Vec3 displacement(const Turn& turn, const Vec3& arm, const Vec3& answer) noexcept {
        return glm::cross(turn.gamma, arm) - glm::cross(turn.alpha, answer);
    }

  private:
    Vec3 centre_{0.0};           // m, of mass
    Mat3 inverse_inertia_{0.0};  // 1/(kg m^2)
    Mat3 turning_{0.0};
};

}  // namespace haptic::sim
