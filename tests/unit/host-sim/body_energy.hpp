// How fast a body moves, whatever its mass.
#pragma once

#include <cstdint>
#include <glm/geometric.hpp>

#include "haptic/sim/particles.hpp"

namespace haptic::sim::test {

/// J/kg, kinetic, of a body.
inline double energy_of(const ParticleModel& model, const ParticleRange& body) {
    double energy = 0.0;
    double mass = 0.0;
    for (std::uint32_t i = body.begin; i < body.end; ++i) {
        energy += 0.5 * model.mass[i] * glm::dot(model.velocity[i], model.velocity[i]);
        mass += model.mass[i];
    }
    return energy / mass;
}

}  // namespace haptic::sim::test
