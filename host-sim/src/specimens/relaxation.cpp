#include "specimens/relaxation.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <vector>

#include "dynamics/rotation.hpp"

namespace haptic::sim {
namespace {

// At rest: several maxima of the kinetic energy in a row are below this share of the highest one, so that a motion
// moves the body by 1e-5 of its way.
constexpr double kRestEnergy = 1e-10;
constexpr int kRestMaxima = 5;

void stop(ParticleModel& model) {
    for (std::size_t i = 0; i < model.size(); ++i) {
        if (model.pinned[i] == 0) {
            model.velocity[i] = Vec3(0.0);
            model.angular_velocity[i] = Vec3(0.0);
        }
    }
}

/// Subtracts translation and small rotation from vectors at the particles, such as displacements: those with the
/// momenta of all of them.
void remove_rigid_part(const ParticleModel& model, std::vector<Vec3>& vectors, const std::vector<Vec3>& subtrahend) {
    double mass = 0.0;
    Vec3 centre(0.0);
    Vec3 mean(0.0);
    for (std::size_t i = 0; i < vectors.size(); ++i) {
        mass += model.mass[i];
        centre += model.mass[i] * model.rest_position[i];
        mean += model.mass[i] * (vectors[i] - subtrahend[i]);
    }
    centre /= mass;
    mean /= mass;
    Vec3 turn(0.0);
    Mat3 scatter(0.0);
    for (std::size_t i = 0; i < vectors.size(); ++i) {
        const Vec3 p = model.rest_position[i] - centre;
        turn += model.mass[i] * glm::cross(p, vectors[i] - subtrahend[i]);
        scatter += model.mass[i] * glm::outerProduct(p, p);
    }
    const Vec3 rotation = solve_inertia(scatter, turn);
    for (std::size_t i = 0; i < vectors.size(); ++i) {
        vectors[i] -= mean + glm::cross(rotation, model.rest_position[i] - centre);
    }
}

}  // namespace

Relaxed relax(ParticleModel& model, std::span<const Vec3> force, const RelaxationSettings& settings) {
    for (ElasticElement& element : model.elasticity.elements) {
        element.damping = 0.0;
    }
    for (ElasticPair& pair : model.elasticity.pairs) {
        pair.damping = 0.0;
    }
    ParticleSolver solver(
        model, {.step = settings.step, .substeps = settings.substeps, .iterations = 1, .gravity = settings.gravity});
    Relaxed result{.substeps = solver.substeps()};
    const std::vector<Vec3> still(model.size(), Vec3(0.0));
    double highest = 0.0;
    double before = 0.0;
    int small_maxima = 0;
    for (int i = 0; i < settings.max_steps && !result.at_rest; ++i) {
        solver.step(model, force, {settings.contacts});
        result.simulated_s += settings.step;
        if (settings.keep_placement) {
            remove_rigid_part(model, model.position, model.rest_position);
            remove_rigid_part(model, model.velocity, still);
        }
        const double energy = kinetic_energy(model);
        if (energy < before) {
            // The last step was the maximum.
            small_maxima = before <= kRestEnergy * highest ? small_maxima + 1 : 0;
            result.at_rest = small_maxima >= kRestMaxima;
            stop(model);
            before = 0.0;
        } else {
            highest = std::max(highest, energy);
            before = energy;
        }
    }
    return result;
}

}  // namespace haptic::sim
