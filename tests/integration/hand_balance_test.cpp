// Claim: the bodies of a scene receive the impulse that the hand feels, though rt-core renders at its own rate, with
// its own limits. Both are measured independently: the hand's as the integral of the wrench of rt-core's tensions over
// its ticks, the bodies' as the force that host-sim's solver applied to them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "haptic/config.hpp"
#include "haptic/sim/scene.hpp"
#include "lockstep.hpp"

namespace haptic::test {
namespace {

constexpr double kTickS = 0.001;
constexpr double kApproachS = 1.0;  // from the device's centre to the begin of the script
// Limits that rt-core imposes by default for the emulated device.
constexpr double kMaxStiffness = 600.0;           // N/m
constexpr double kMaxRotationalStiffness = 0.12;  // N*m/rad

struct BalanceCase {
    const char* scene;
    double seconds;
    double max_stiffness = kMaxStiffness;  // N/m, of rt-core
    double tolerance = 0.01;
};

/// The scene's scripted hand in the device frame, after a second on the way there from the centre.
PoseTrack script_of(const sim::Scene& scene, double duration_s) {
    const sim::Simulation simulation(scene);
    std::vector<double> times{0.0};
    std::vector<Pose> poses{Pose{}};
    for (double t = 0.0; t <= duration_s; t += 0.01) {
        times.push_back(kApproachS + t);
        poses.push_back(simulation.scripted_input(nanoseconds(t)).device);
    }
    return {std::move(times), std::move(poses)};
}

/// Holds the grip's buttons as the script does.
void hold_buttons(Lockstep& chain, double script_s) {
    const std::uint32_t buttons = chain.simulation().scripted_input(nanoseconds(script_s)).buttons;
    chain.board().device().set_buttons(static_cast<std::uint8_t>(buttons));
}

/// The chain with rt-core's default limits. The hand goes to where the script begins before the scene starts.
Lockstep chain_with_script(const sim::Scene& scene, double duration_s, double max_stiffness = kMaxStiffness,
                           std::int64_t network_ns = 0) {
    Lockstep::Settings settings{
        .scene = scene, .hand = script_of(scene, duration_s), .tick = {}, .network_ns = network_ns};
    settings.tick.frames.max_stiffness = max_stiffness;
    settings.tick.frames.max_rotational_stiffness = kMaxRotationalStiffness;
    return Lockstep(settings);
}
void approach(Lockstep& chain) {
    chain.stand(static_cast<int>(kApproachS / seconds(sim::ContactFramePublisher::kIdlePeriodNs)),
                [](const rt::TickRecord&, const device::EmulatedBoard&) {});
}

class HandBalance : public ::testing::TestWithParam<BalanceCase> {};

TEST_P(HandBalance, BodiesReceiveTheImpulseThatTheHandFeels) {
    const sim::Scene scene = sim::read_scene(sim::open_scene(GetParam().scene), GetParam().scene);
    Lockstep chain = chain_with_script(scene, GetParam().seconds, GetParam().max_stiffness);
    approach(chain);

    // N*s, sums over tenths of a second of the impulse on the bodies, and of the hand's along it. Across it the hand
    // feels the quantisation of the tensions only.
    double on_hand = 0.0;
    double on_bodies = 0.0;
    Vec3 felt(0.0);
    Vec3 given(0.0);
    bool touched = false;
    bool limited = false;
    const int steps_per_sum = std::max(1, static_cast<int>(0.1 / scene.solver.step));
    for (int i = 1; i * scene.solver.step < GetParam().seconds; ++i) {
        hold_buttons(chain, i * scene.solver.step);
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
    EXPECT_NEAR(on_hand / on_bodies, 1.0, GetParam().tolerance) << on_hand << " and " << on_bodies << " N s";
    EXPECT_EQ(limited, GetParam().max_stiffness < 100.0);
}

INSTANTIATE_TEST_SUITE_P(Scenes, HandBalance,
                         ::testing::Values(BalanceCase{"fish-hold", 8.0}, BalanceCase{"fish-hold", 8.0, 50.0},
                                           BalanceCase{"plane-slide", 5.0}, BalanceCase{"fish-grab", 6.6},
                                           BalanceCase{"curtain-hand", 2.5},
                                           // The hand still feels fish that it has knocked away.
                                           BalanceCase{"four-fish", 6.0, kMaxStiffness, 0.02},
                                           BalanceCase{"fish-slide", 6.0}, BalanceCase{"rod-gap", 4.0},
                                           BalanceCase{"popout-fan", 8.0}, BalanceCase{"cloth-drop", 2.5},
                                           BalanceCase{"gel-block", 6.0}, BalanceCase{"organ-lift", 6.0}),
                         [](const auto& which) {
                             std::string name = which.param.scene;
                             for (char& c : name) {
                                 c = c == '-' ? '_' : c;
                             }
                             return name + (which.param.max_stiffness < 100.0 ? "_limited" : "");
                         });

struct Carried {
    const char* name;
    double network_s;  // one-way delay of a network between the two
    double step_s;     // of the scene
};

class HeldFish : public ::testing::TestWithParam<Carried> {};

// While the hand of fish-grab carries the fish, rolls it and stands still.
TEST_P(HeldFish, WeighsAtTheHandWhatItWeighsInTheSceneTimesTheForceScale) {
    constexpr double kFrom = 2.1;   // s, of the script: the hand stands still from here
    constexpr double kUntil = 4.6;  // s; rolled to either side meanwhile
    sim::Scene scene = sim::read_scene(sim::open_scene("fish-grab"), "fish-grab");
    scene.solver.step = GetParam().step_s;
    Lockstep chain = chain_with_script(scene, kUntil, kMaxStiffness, nanoseconds(GetParam().network_s));
    approach(chain);
    Vec3 felt(0.0);  // N, sum over the ticks
    int ticks = 0;
    for (int i = 1; i * scene.solver.step < kUntil; ++i) {
        hold_buttons(chain, i * scene.solver.step);
        chain.step([&](const rt::TickRecord& tick, const device::EmulatedBoard&) {
            if (i * scene.solver.step > kFrom) {
                felt += tick.made.force;
                ++ticks;
            }
        });
    }
    double mass = 0.0;
    for (const double m : chain.simulation().model().mass) {
        mass += m;
    }
    const double weight = mass * glm::length(scene.solver.gravity) * scene.workspace.force_scale;
    felt /= ticks;
    RecordProperty("weight_N", std::to_string(-felt.y));
    EXPECT_NEAR(-felt.y, weight, 0.05 * weight);
}

INSTANTIATE_TEST_SUITE_P(Networks, HeldFish,
                         ::testing::Values(Carried{"OnOneMachine", 0.0, 0.002}, Carried{"Over5ms", 0.005, 0.002},
                                           Carried{"Over20ms", 0.02, 0.002},
                                           Carried{"Over10msAtShortSteps", 0.01, 0.001}),
                         [](const auto& which) { return std::string(which.param.name); });

}  // namespace
}  // namespace haptic::test
