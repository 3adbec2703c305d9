// Claims about sheets and solids: a sheet that falls on a solid gains no energy from contacts and comes to rest, and
// one that is held carries what falls on it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <ostream>
#include <string>
#include <vector>

#include "body_energy.hpp"
#include "haptic/config.hpp"
#include "haptic/sim/simulation.hpp"

namespace haptic::sim {
namespace {

struct Fall {
    std::string solid;
    std::string material;
    double height = 0.16;  // m
    double step = 0.01;    // s
};

void PrintTo(const Fall& fall, std::ostream* out) {
    *out << fall.material << " on " << fall.solid << " from " << fall.height << " m at " << fall.step << " s";
}

const std::string kFish = R"(
generator = "fish"
particles_count = 137
height = 0.03
orientation = [0.7071067811865476, -0.7071067811865475, 0.0, 0.0]
[model.material]
name = "fish flesh"
)";

const std::string kBlock = R"(
generator = "block"
size = [0.16, 0.06, 0.1]
cells = 20
particles_count = 300
offset = [0.0, 0.03, 0.0]
[model.material]
young_modulus = 60000.0
)";

const std::string kHeld = R"(
[[model.regions]]
low = [-1.0, -1.0, -1.0]
high = [1.0, 1.0, 1.0]
fixed = true
)";

// The hand is elsewhere. Keys of [collisions] may follow.
const std::string kAround = R"(
[hand]
times = [0.0]
positions = [2.0, 0.5, 0.0]
[collisions]
static_friction = 0.5
dynamic_friction = 0.4
)";

/// A square of 0.4 m.
std::string sheet_of(const std::string& material, double height) {
    return R"(
[[objects]]
generator = "cloth"
vertices_per_side = 17
side = 0.4
height = )" +
           std::to_string(height) + "\n[objects.material]\nname = \"" + material + "\"\n";
}

/// A sheet above a solid that lies on the ground.
Simulation above(const Fall& fall) {
    const bool is_fish = fall.solid.find("fish") != std::string::npos;
    const bool is_held = fall.solid.find("held") != std::string::npos;
    const std::string toml = "[model]" + (is_fish ? kFish : kBlock) + (is_held ? kHeld : "") +
                             sheet_of(fall.material, fall.height) + "[solver]\nstep = " + std::to_string(fall.step) +
                             kAround + "ground = true\n";
    return Simulation(read_scene(Config::parse(toml, "fall.toml"), "fall"));
}

class FallingSheet : public ::testing::TestWithParam<Fall> {};

TEST_P(FallingSheet, IsNeverFasterThanItsFallAndComesToRest) {
    const Fall& fall = GetParam();
    Simulation simulation = above(fall);
    simulation.set_verification(true);
    const double fallen = 9.81 * fall.height;  // J/kg
    double late = 0.0;
    double last = 0.0;
    for (int i = 0; simulation.time() < 2.5; ++i) {
        const StepResult result = simulation.step(simulation.scripted_input(nanoseconds(simulation.time())));
        ASSERT_EQ(
            result.surfaces.sheets + result.surfaces.solids + result.surfaces.others + result.surfaces.below_ground, 0u)
            << "step " << i;
        const double energy = test::energy_of(simulation.model(), simulation.model().bodies.back());
        ASSERT_LT(energy, fallen) << simulation.time() << " s";
        if (simulation.time() > 0.8) {
            late = std::max(late, energy);
        }
        if (simulation.time() > 2.0) {
            last = std::max(last, energy);
        }
    }
    EXPECT_LT(late, 0.1 * fallen);
    EXPECT_LT(last, 0.005);  // 0.1 m/s
}

INSTANTIATE_TEST_SUITE_P(OnSolids, FallingSheet,
                         ::testing::Values(Fall{"fish", "cotton", 0.13}, Fall{"fish", "cotton", 0.25},
                                           Fall{"fish", "cotton", 0.2, 0.005}, Fall{"fish", "cotton", 0.2, 0.02},
                                           Fall{"fish", "cotton", 0.2, 0.033}, Fall{"fish", "silk"},
                                           Fall{"fish", "paper"}, Fall{"held fish", "cotton"},
                                           Fall{"block", "cotton", 0.13}, Fall{"held block", "latex"}));

TEST(HeldSheet, CarriesABlockThatFallsOnIt) {
    // Its corner, the first particle, is held like all of its border.
    std::string toml = R"([model]
generator = "block"
size = [0.1, 0.04, 0.08]
cells = 12
particles_count = 120
offset = [0.0, 0.1, 0.0]
[model.material]
young_modulus = 60000.0
density = 1000.0
)" + sheet_of("cotton", 0.0) +
                       kAround;
    for (const char* const edge :
         {"low = [-1.0, -1.0, -1.0]\nhigh = [-0.19, 1.0, 1.0]", "low = [0.19, -1.0, -1.0]\nhigh = [1.0, 1.0, 1.0]",
          "low = [-1.0, -1.0, -1.0]\nhigh = [1.0, 1.0, -0.19]", "low = [-1.0, -1.0, 0.19]\nhigh = [1.0, 1.0, 1.0]"}) {
        toml += std::string("[[objects.regions]]\n") + edge + "\nfixed = true\n";
    }
    Simulation simulation(read_scene(Config::parse(toml, "held.toml"), "held"));
    simulation.set_verification(true);
    int stood_still = 0;
    while (simulation.time() < 2.0) {
        const StepResult result = simulation.step(simulation.scripted_input(nanoseconds(simulation.time())));
        stood_still += result.stood_still ? 1 : 0;
        ASSERT_EQ(result.surfaces.solids + result.surfaces.others, 0u) << simulation.time() << " s";
    }
    double lowest = 0.0;
    for (std::uint32_t i = simulation.model().bodies[1].begin; i < simulation.model().bodies[1].end; ++i) {
        lowest = std::min(lowest, simulation.model().position[i].y);
    }
    EXPECT_LT(lowest, -0.015) << "the sheet does not yield to 0.3 kg";
    EXPECT_EQ(stood_still, 0) << "steps in which the sheet had to wait for the block";
    const ParticleModel& model = simulation.model();
    for (std::uint32_t i = model.bodies[0].begin; i < model.bodies[0].end; ++i) {
        EXPECT_GT(model.position[i].y, lowest);
        EXPECT_LT(glm::length(model.velocity[i]), 0.3);  // it still bounces
    }
}

}  // namespace
}  // namespace haptic::sim
