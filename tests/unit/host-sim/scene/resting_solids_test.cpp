// Solids that nothing touches come to rest on the ground, on one another and in what holds them, and stay there.
#include <gtest/gtest.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <ostream>
#include <string>
#include <vector>

#include "body_energy.hpp"
#include "dynamics/model_bodies.hpp"
#include "haptic/sim/simulation.hpp"
#include "scene_with.hpp"

namespace haptic::sim {
namespace {

struct Rest {
    std::string scene;
    double step;         // s
    double from;         // s, when it rests
    double until;        // s
    double energy;       // J/kg, at most
    bool alone = false;  // one of several
    double aside = 0.0;  // m, of those that fall later
};

void PrintTo(const Rest& rest, std::ostream* out) {
    *out << rest.scene << " at " << rest.step << " s until " << rest.until << " s";
}

class RestingSolids : public ::testing::TestWithParam<Rest> {};

/// The hand is elsewhere.
Simulation untouched(const Rest& rest, double sleep_after) {
    std::vector<std::string> assignments{"solver.step=" + std::to_string(rest.step), "hand.times=[0.0]",
                                         "hand.positions=[0.5,0.4,0.0]",
                                         "solver.sleep_after=" + std::to_string(sleep_after)};
    if (rest.alone) {
        assignments.emplace_back(
            "model.copies=[{position=[0.0,0.05,0.0],orientation=[0.70710678,-0.70710678,0.0,0.0]}]");
    }
    if (rest.aside != 0.0) {
        const std::string x = std::to_string(rest.aside);
        assignments.push_back(
            "model.copies=[{position=[0.0,0.05,0.0],orientation=[0.70710678,-0.70710678,0.0,0.0]},"
            "{position=[" +
            x +
            ",0.15,0.02],orientation=[0.5,-0.5,0.5,0.5]},"
            "{position=[-0.02,0.25," +
            x +
            "],orientation=[0.70710678,0.70710678,0.0,0.0]},"
            "{position=[0.02,0.35,0.0],orientation=[0.5,0.5,0.5,-0.5]}]");
    }
    return Simulation(test::scene_with(rest.scene, assignments));
}

// Bodies that sleep would rest by definition.
TEST_P(RestingSolids, HaveNoEnergyAndDoNotCreep) {
    const Rest& rest = GetParam();
    Simulation simulation = untouched(rest, 0.0);
    const auto step_until = [&](double time, const auto& visit) {
        while (simulation.time() < time) {
            simulation.step(simulation.scripted_input(nanoseconds(simulation.time())));
            visit();
        }
    };
    step_until(rest.from, [] {});
    const ParticleModel then = simulation.model();
    double most = 0.0;
    step_until(rest.until, [&] {
        for (const ParticleRange& body : bodies_of(simulation.model())) {
            most = std::max(most, test::energy_of(simulation.model(), body));
        }
    });
    EXPECT_LT(most, rest.energy);
    for (const ParticleRange& body : bodies_of(then)) {
        EXPECT_LT(glm::length(centre_of_mass(simulation.model(), body) - centre_of_mass(then, body)), 3e-4);
    }
}

TEST_P(RestingSolids, FallAsleep) {
    Simulation simulation = untouched(GetParam(), 0.5);
    std::size_t asleep = 0;
    while (simulation.time() < GetParam().until) {
        asleep = simulation.step(simulation.scripted_input(nanoseconds(simulation.time()))).asleep;
    }
    EXPECT_EQ(asleep, simulation.bodies().size());
}

// In the heaps in which fish fall a little aside, a fin lies between a fish and the ground, or between two.
INSTANTIATE_TEST_SUITE_P(OfScenes, RestingSolids,
                         ::testing::Values(Rest{"four-fish", 0.01, 40.0, HAPTIC_UNTIL_S, 1e-6},
                                           Rest{"four-fish", 0.02, 40.0, HAPTIC_UNTIL_S, 1e-6},
                                           Rest{"four-fish", 0.01, 52.0, HAPTIC_UNTIL_S, 1e-6, false, 0.04},
                                           Rest{"four-fish", 0.01, 52.0, HAPTIC_UNTIL_S, 1e-6, false, 0.01},
                                           Rest{"four-fish", 0.01, 15.0, 25.0, 1e-6, true},
                                           Rest{"four-fish", 0.002, 15.0, 25.0, 1e-6, true},
                                           Rest{"organ-lift", 0.005, 6.0, 10.0, 1e-12},
                                           Rest{"organ-lift", 0.02, 6.0, 10.0, 1e-12}));

// A thin block lies between the ground and one that is fixed, with as little room as it has.
TEST(SqueezedSolids, AreNotDrivenOut) {
    Simulation simulation(test::scene_with(
        "gel-block", {"hand.times=[0.0]", "hand.positions=[0.5,0.4,0.0]", "model.size=[0.16,0.008,0.1]",
                      "model.cells=24", "model.particles_count=150", "model.offset=[0.0,-0.046,0.0]",
                      "model.regions=[{low=[-1.0,-1.0,-1.0],high=[1.0,1.0,1.0],fixed=false}]", "collisions.ground=true",
                      "collisions.ground_height=-0.05",
                      "objects=[{generator=\"block\",size=[0.16,0.02,0.1],cells=24,particles_count=300,"
                      "offset=[0.0,-0.0325,0.0],material={name=\"gelatin 10 %\"},"
                      "regions=[{low=[-1.0,-1.0,-1.0],high=[1.0,1.0,1.0],fixed=true}]}]"}));
    for (int k = 0; k < 300; ++k) {
        simulation.step(simulation.scripted_input(nanoseconds(simulation.time())));
    }
    // It begins within 0.101 m, and spreads.
    for (const Vec3& p : simulation.model().position) {
        EXPECT_LT(glm::length(p), 0.115);
    }
}

}  // namespace
}  // namespace haptic::sim
