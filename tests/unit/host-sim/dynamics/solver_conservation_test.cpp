// Conservation by a free fish-like body over a minute: momenta up to rounding, and energy that never grows.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "dynamics/rotation.hpp"
#include "free_motion.hpp"
#include "haptic/denormals.hpp"
#include "haptic/sim/solver.hpp"
#include "strewn_body.hpp"

namespace haptic::sim {
namespace {

/// Bends the body into an arc whose ends are displaced by `height`, m, and makes it spin and translate.
void bend_and_throw(ParticleModel& model, double height) {
    const Vec3 rate(1.0, 4.0, 2.0);  // rad/s
    for (std::size_t i = 0; i < model.size(); ++i) {
        Vec3& x = model.position[i];
        const double along = x.x / 0.15;
        x.z += height * along * along;
        model.orientation[i] = turned(model.orientation[i], {0.0, -2.0 * height * along / 0.15, 0.0});
        model.velocity[i] = Vec3(0.3, -0.2, 0.1) + glm::cross(rate, x);
        model.angular_velocity[i] = rate;
    }
}

Vec3 spin_about_centre(const ParticleModel& model) {
    double mass = 0.0;
    Vec3 centre(0.0);
    for (std::size_t i = 0; i < model.size(); ++i) {
        mass += model.mass[i];
        centre += model.mass[i] * model.position[i];
    }
    return angular_momentum(model) - glm::cross(centre / mass, linear_momentum(model));
}

/// Energy of compliant groups, J: 1/2 sum m |d|^2 / compliance, with d from the best fit of the positions alone. A
/// lower bound of the energy that the groups store.
double elastic_energy(const ParticleModel& model) {
    double energy = 0.0;
    for (const Group& group : model.groups) {
        double mass = 0.0;
        Vec3 rest(0.0);
        Vec3 present(0.0);
        for (const std::uint32_t i : group.members) {
            mass += model.mass[i];
            rest += model.mass[i] * model.rest_position[i];
            present += model.mass[i] * model.position[i];
        }
        rest /= mass;
        present /= mass;
        Mat3 moment(0.0);
        for (const std::uint32_t i : group.members) {
            moment += model.mass[i] * glm::outerProduct(model.position[i] - present, model.rest_position[i] - rest);
        }
        const Mat3 fit = to_matrix(extract_rotation(moment, model.orientation[group.centre], 20));
        for (const std::uint32_t i : group.members) {
            const Vec3 lacks = fit * (model.rest_position[i] - rest) - (model.position[i] - present);
            energy += 0.5 * model.mass[i] * glm::dot(lacks, lacks) / group.compliance;
        }
    }
    return energy;
}

constexpr int kMinute = 6000;  // steps of 0.01 s

TEST(SolverConservation, ABentSpinningBodyKeepsItsMomentaAndLosesEnergyOverAMinute) {
    const FlushDenormals flush;
    ParticleModel model = strewn_body(1, 0.6);
    bend_and_throw(model, 0.04);
    ParticleSolver solver(model, kFree);
    const Vec3 linear = linear_momentum(model);
    const Vec3 spin = spin_about_centre(model);
    double highest = 0.0;  // J, while the bend is converted to motion
    for (int i = 0; i < 20; ++i) {
        solver.step(model, {});
        highest = std::max(highest, inner_kinetic_energy(model));
    }
    for (int i = 20; i < kMinute; ++i) {
        solver.step(model, {});
        ASSERT_LE(inner_kinetic_energy(model), highest) << "step " << i;
    }
    // Rounding only. The body ends 22 m away, where a position has a precision of 4e-15 m and a velocity of 4e-13 m/s;
    // each of 6,000 steps rounds 45 times.
    EXPECT_LT(glm::length(linear_momentum(model) - linear), 1e-8 * glm::length(linear));
    EXPECT_LT(glm::length(spin_about_centre(model) - spin), 1e-10 * glm::length(spin));
}

TEST(SolverConservation, ASpinningBodyNeverMovesMoreThanAtFirst) {
    const FlushDenormals flush;
    for (const double stiffness : {0.1, 0.6, 1.0}) {
        ParticleModel model = strewn_body(2, stiffness);
        bend_and_throw(model, 0.0);
        ParticleSolver solver(model, kFree);
        const double start = inner_kinetic_energy(model);  // its whole energy: it has its rest shape
        solver.step(model, {});
        // The first step replaces tangents by chords: an error of the order of the squared rotation within a step.
        const double turn = kFree.step * glm::length(model.angular_velocity[0]);
        EXPECT_LE(inner_kinetic_energy(model), start * (1.0 + 0.25 * turn * turn));
        for (int i = 1; i < kMinute / 6; ++i) {
            solver.step(model, {});
            ASSERT_LE(inner_kinetic_energy(model), start) << stiffness << ", step " << i;
        }
        EXPECT_GT(inner_kinetic_energy(model), 0.9 * start);  // it still spins
    }
}

TEST(SolverConservation, ACompliantBodyNeverHasMoreEnergyThanAtFirst) {
    const FlushDenormals flush;
    for (const double compliance : {1e-4, 1e-3, 1e-2}) {
        ParticleModel model = strewn_body(3, 1.0);
        for (Group& group : model.groups) {
            group.compliance = compliance;
        }
        bend_and_throw(model, 0.04);
        ParticleSolver solver(model, kFree);
        const auto energy = [&] { return inner_kinetic_energy(model) + elastic_energy(model); };
        const double start = energy();
        for (int i = 0; i < kMinute / 10; ++i) {
            solver.step(model, {});
            ASSERT_LE(energy(), start) << compliance << " s^2, step " << i;
        }
        EXPECT_GT(energy(), 0.2 * start);  // it still spins
    }
}

}  // namespace
}  // namespace haptic::sim
