// Claim: the bodies of a scene receive the impulse that the hand feels, though rt-core renders at its own rate, with
// its own limits. Both are measured independently: the hand's as the integral of the wrench of rt-core's tensions over
// its ticks, the bodies' as the force that host-sim's solver applied to them.
#include <gtest/gtest.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "haptic/config.hpp"
#include "haptic/sim/scene.hpp"
#include "lockstep.hpp"

namespace haptic::test {
namespace {

constexpr double kTickS = 0.001;

struct Case {
    const char* scene;
    double seconds;
    std::vector<std::string> settings{};
    double max_stiffness = 600.0;  // N/m, of rt-core
};

/// The scene's scripted hand in the device frame, after a second on the way there from the centre.
PoseTrack script_of(const sim::Scene& scene, double duration_s) {
    const sim::Simulation simulation(scene);
    std::vector<double> times{0.0};
    std::vector<Pose> poses{Pose{}};
    for (double t = 0.0; t <= duration_s; t += 0.01) {
        times.push_back(1.0 + t);
        poses.push_back(simulation.scripted_input(nanoseconds(t)).device);
    }
    return {std::move(times), std::move(poses)};
}

class HandBalance : public ::testing::TestWithParam<Case> {};

TEST_P(HandBalance, BodiesReceiveTheImpulseThatTheHandFeels) {
    Config config = sim::open_scene(GetParam().scene);
    for (const std::string& assignment : GetParam().settings) {
        config.set(assignment);
    }
    const sim::Scene scene = sim::read_scene(config, GetParam().scene);
    Lockstep::Settings settings{.scene = scene, .hand = script_of(scene, GetParam().seconds), .tick = {}};
    settings.tick.frames.max_stiffness = GetParam().max_stiffness;
    Lockstep chain(settings);

    // N*s, sums over tenths of a second of the impulse on the bodies, and of the hand's along it. Across it the hand
    // feels the quantisation of the tensions only.
    double on_hand = 0.0;
    double on_bodies = 0.0;
    Vec3 felt(0.0);
    Vec3 given(0.0);
    bool touched = false;
    bool limited = false;
    const int steps_per_sum = std::max(1, static_cast<int>(0.1 / scene.solver.step));
    for (int i = 1; i * scene.solver.step < 1.0 + GetParam().seconds; ++i) {
        const sim::StepResult result = chain.step(
            [&](const rt::TickRecord& tick, const device::EmulatedBoard&) { felt += kTickS * tick.made.force; });
        given += result.body_impulse;
        touched = touched || result.in_contact;
        limited = limited || (chain.input().feedback && chain.input().feedback->stiffness_limited);
        if (i % steps_per_sum == 0) {
            const double size = glm::length(given);
            on_hand += !touched ? 0.0 : size > 0.0 ? glm::dot(felt, given) / size : glm::length(felt);
            on_bodies += size;
            felt = given = Vec3(0.0);
            touched = false;
        }
    }
    RecordProperty("ratio", std::to_string(on_hand / on_bodies));
    EXPECT_GT(on_bodies, 0.01) << "too little contact to measure";
    EXPECT_NEAR(on_hand / on_bodies, 1.0, 0.01) << on_hand << " and " << on_bodies << " N s";
    EXPECT_EQ(limited, GetParam().max_stiffness < 100.0);
}

INSTANTIATE_TEST_SUITE_P(Scenes, HandBalance,
                         ::testing::Values(Case{"fish-hold", 8.0}, Case{"fish-hold", 8.0, {}, 50.0},
                                           Case{"plane-slide", 5.0}),
                         [](const auto& which) {
                             std::string name = which.param.scene;
                             for (char& c : name) {
                                 c = c == '-' ? '_' : c;
                             }
                             return name + (which.param.max_stiffness < 100.0 ? "_limited" : "");
                         });

}  // namespace
}  // namespace haptic::test
