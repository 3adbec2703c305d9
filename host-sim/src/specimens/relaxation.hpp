// Dynamic relaxation: a body under constant forces comes to rest by the solver that the scenes use.
//
// Whenever the kinetic energy has passed a maximum all velocities are set to 0 (kinetic damping). That needs no
// estimate of the slowest motion, and what is at rest is the same as with any other damping.
// @source P. A. Cundall, "Explicit finite-difference methods in geomechanics", 1976
#pragma once

#include <span>

#include "haptic/sim/particles.hpp"
#include "haptic/sim/solver.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

struct RelaxationSettings {
    double step = 0.01;  // s
    int substeps = 0;    // 0: chosen from the material
    Vec3 gravity{0.0};   // m/s^2
    int max_steps = 8'000;
    /// Takes rigid motion out of each step. Forces that balance but do not turn with the body make a free one tip over
    /// where they press.
    bool keep_placement = false;
    SolverContacts* contacts = nullptr;  // that hold the body too; none: null
};

struct Relaxed {
    int substeps = 0;  // of a step, used
    double simulated_s = 0.0;
    bool at_rest = false;
};

/// Moves the model to its equilibrium with `force`, N, per particle, constant. Damping of the material is left out: it
/// has no part in the equilibrium. Throws std::invalid_argument as ParticleSolver does.
[[nodiscard]] Relaxed relax(ParticleModel& model, std::span<const Vec3> force, const RelaxationSettings& settings);

}  // namespace haptic::sim
