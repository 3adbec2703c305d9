#include "haptic/rt/tick.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <memory>
#include <numeric>
#include <vector>

#include "tick_rig.hpp"

namespace haptic::rt {
namespace {

using test::floor_frame;
using test::TickRig;

constexpr double kMillimetre = 1e-3;
constexpr double kDigit_n = 1.0 / (0.365296803653 * 415.0);  // N, that one D/A digit stands for

/// The hand holds still while the loop arms, then moves by `to` in 0.3 s and stays there.
PoseTrack hand_to(const Vec3& to) {
    return PoseTrack({0.0, 1.0, 1.3, 10.0}, {Pose{}, Pose{}, Pose{to, Quat(1, 0, 0, 0)}, Pose{to, Quat(1, 0, 0, 0)}});
}

double sum(const StringArray& values) {
    return std::accumulate(values.begin(), values.end(), 0.0);
}

TEST(Tick, CarriesNoTensionUntilItIsArmed) {
    TickRig rig;
    rig.steps(50);
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Disarmed);
    EXPECT_EQ(sum(rig.board.tensions()), 0.0);
}

TEST(Tick, RunsAtMinimumTensionAfterArming) {
    TickRig rig;
    rig.run_up();
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Running);
    for (const double tension : rig.board.tensions()) {
        // Digits are truncated.
        EXPECT_GE(tension, rig.settings.variant.minimum_tension - kDigit_n);
    }
    EXPECT_LT(glm::length(rig.board.wrench().force), 0.05);
}

TEST(Tick, FollowsTheHandWithinEncoderQuantisation) {
    const Vec3 to(0.012, -0.02, 0.015);
    TickRig rig(hand_to(to));
    rig.run_up();
    rig.steps(1200);
    EXPECT_LT(glm::length(rig.tick.last().pose.position - to), 0.05 * kMillimetre);
    DeviceState state{};
    ASSERT_TRUE(rig.states_in.read_newest(state));
    EXPECT_LT(glm::length(to_vec3(state.position) - to), 0.05 * kMillimetre);
    EXPECT_EQ(state.safety_state, HAPTIC_RUNNING);
}

TEST(Tick, MakesTheSpringForceOfAFloorAtTheBoard) {
    // 5 mm into a floor of 400 N/m: 2 N upward.
    TickRig rig(hand_to({0.0, -0.02, 0.0}));
    rig.run_up();
    for (int i = 0; i < 1500; ++i) {
        if (i % 10 == 0) {
            rig.publish(floor_frame(-0.015, 400.0, rig.now_ns));
        }
        rig.step();
    }
    EXPECT_NEAR(rig.tick.last().rendered.force.y, 2.0, 0.02);
    // Eight strings, each short of its tension by less than a digit.
    EXPECT_LT(glm::length(rig.board.wrench().force - Vec3(0.0, 2.0, 0.0)), 8 * kDigit_n);
    EXPECT_LT(glm::length(rig.board.wrench().force - rig.tick.last().made.force), 1e-3);
    EXPECT_EQ(rig.tick.instruments().frames_received, 150u);
}

}  // namespace
}  // namespace haptic::rt
