// Free motion: without gravity, and the part of its energy that can be lost without a change of momentum.
#pragma once

#include <glm/geometric.hpp>

#include "haptic/sim/solver.hpp"

namespace haptic::sim {

inline constexpr SolverSettings kFree{.gravity = {0.0, 0.0, 0.0}};

/// Kinetic energy relative to the centre of mass, J.
inline double inner_kinetic_energy(const ParticleModel& model) {
    double mass = 0.0;
    for (const double m : model.mass) {
        mass += m;
    }
    const Vec3 p = linear_momentum(model);
    return kinetic_energy(model) - 0.5 * glm::dot(p, p) / mass;
}

}  // namespace haptic::sim
