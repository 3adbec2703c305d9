// Claim: the script of fish-grab picks the fish up in every cycle and puts it down where the next one finds it, also
// from a start 1 mm and 1 degree aside, and a hand that opens does not throw it. From 2 mm and 2 degrees, three starts
// in eight let it put the fish down where it misses it after one to three cycles. The oracle is the fish's height, from
// its particles.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <numbers>

#include "haptic/sim/scene.hpp"
#include "haptic/sim/simulation.hpp"
#include "haptic/types.hpp"
#include "soak_length.hpp"

namespace haptic::sim {
namespace {

constexpr double kLifted = 0.1;     // m, of the fish's centre
constexpr double kOnGround = 0.03;  // m: it lies 0.02 m high
// m/s: a particle of a fish that falls by 0.2 m moves with 2 m/s, and its fins flap faster.
constexpr double kThrown = 8.0;

/// Where the fish lies at the start, from the scene's own place.
struct Start {
    double x = 0.0;     // m
    double z = 0.0;     // m
    double turn = 0.0;  // degrees, about the vertical
};

class LiftCycles : public ::testing::TestWithParam<Start> {};

Scene scene_from(const Start& start) {
    Scene scene = read_scene(open_scene("fish-grab"), "fish-grab");
    const double angle = start.turn * std::numbers::pi / 180.0;
    Placement& fish = scene.model.copies.at(0);
    fish.position += Vec3(start.x, 0.0, start.z);
    fish.orientation = glm::angleAxis(angle, Vec3(0.0, 1.0, 0.0)) * fish.orientation;
    return scene;
}

double height(const ParticleModel& fish) {
    double sum = 0.0;
    for (const Vec3& p : fish.position) {
        sum += p.y;
    }
    return sum / static_cast<double>(fish.size());
}

TEST_P(LiftCycles, LiftTheFishEachTime) {
    Simulation simulation(scene_from(GetParam()));
    const double cycle = simulation.scene().duration_s;
    const int cycles = test::soak_length(HAPTIC_CYCLES);
    for (int k = 0; k < cycles; ++k) {
        double highest = 0.0;
        double fastest = 0.0;
        while (simulation.time() < (k + 1) * cycle) {
            (void)simulation.step(simulation.scripted_input(nanoseconds(simulation.time())));
            highest = std::max(highest, height(simulation.model()));
            for (const Vec3& velocity : simulation.model().velocity) {
                fastest = std::max(fastest, glm::length(velocity));
            }
        }
        ASSERT_GT(highest, kLifted) << "cycle " << k;
        ASSERT_LT(height(simulation.model()), kOnGround) << "cycle " << k;
        EXPECT_LT(fastest, kThrown) << "cycle " << k;
    }
}

INSTANTIATE_TEST_SUITE_P(FromTheScenesPlace, LiftCycles, ::testing::Values(Start{}));
#ifdef HAPTIC_OTHER_STARTS
INSTANTIATE_TEST_SUITE_P(FromAside, LiftCycles,
                         ::testing::Values(Start{0.001, 0.0, 1.0}, Start{0.001, 0.0, -1.0}, Start{-0.001, 0.0, 1.0},
                                           Start{-0.001, 0.0, -1.0}, Start{0.0, 0.001, 1.0}, Start{0.0, 0.001, -1.0},
                                           Start{0.0, -0.001, 1.0}, Start{0.0, -0.001, -1.0}));
#endif

}  // namespace
}  // namespace haptic::sim
