// The tick with simulated mechanics: a grip with mass, elastic strings and a compliant hand.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "haptic/device/grip_mechanics.hpp"
#include "tick_rig.hpp"

namespace haptic::rt {
namespace {

using test::floor_frame;
using test::TickRig;

/// At the centre for two seconds, then to another pose within half a second.
PoseTrack hand_that_goes_to(const Pose& pose) {
    return {{0.0, 2.0, 2.5}, {Pose{}, Pose{}, pose}};
}

TEST(MechanicsInTheLoop, PoseOfACompliantGripIsMeasuredThroughElasticStrings) {
    TickRig rig(hand_that_goes_to({{0.015, -0.01, 0.008}, glm::normalize(Quat(1.0, 0.1, -0.05, 0.08))}), {},
                device::GripMechanics{});
    rig.run_up();
    ASSERT_EQ(rig.tick.safety_state(), SafetyState::Running);
    double furthest = 0.0;
    while (rig.now_ns < 4'000'000'000) {
        rig.step();
        const Pose grip = rig.board.device().grip_pose();
        const TickRecord& record = rig.tick.last();
        // The uneven pull of the strings moves the grip by 0.06 mm at the calibration, and the strings stretch by 15 um
        // at their minimum tension.
        EXPECT_LT(glm::length(record.pose.position - grip.position), 1.2e-4);
        EXPECT_LT(2.0 * std::acos(std::min(1.0, std::abs(glm::dot(record.pose.orientation, grip.orientation)))), 5e-3);
        furthest = std::max(furthest, glm::length(grip.position));
    }
    EXPECT_GT(furthest, 0.018);
    EXPECT_EQ(rig.tick.faults(), 0U);
}

TEST(MechanicsInTheLoop, HandAndFloorAreTwoSpringsInARow) {
    constexpr double kFloor = 300.0;  // N/m
    constexpr double kDown = 0.008;   // m
    TickRig rig(hand_that_goes_to({{0.0, -kDown, 0.0}, Quat(1.0, 0.0, 0.0, 0.0)}), {}, device::GripMechanics{});
    rig.run_up();
    ASSERT_EQ(rig.tick.safety_state(), SafetyState::Running);
    while (rig.now_ns < 6'000'000'000) {
        rig.publish(floor_frame(0.0, kFloor, rig.now_ns));
        rig.step();
    }
    // K (down - y) = k y, up to the friction of two motors and the truncation of DAC codes: 50 mN.
    const double stiffness = device::GripMechanics{}.hand_stiffness;
    const double depth = kDown * stiffness / (stiffness + kFloor);
    EXPECT_NEAR(rig.board.device().grip_pose().position.y, -depth, 0.05 / stiffness + 6e-5);
    EXPECT_NEAR(rig.tick.last().made.force.y, kFloor * depth, 0.05);
    EXPECT_NEAR(rig.board.device().wrench().force.y, kFloor * depth, 0.1);
    EXPECT_LT(glm::length(rig.board.device().grip_velocity().linear), 1e-3) << "it comes to rest";
    EXPECT_EQ(rig.tick.faults(), 0U);
}

TEST(MechanicsInTheLoop, AFreeGripIsHeldByTheStringsAlone) {
    TickRig rig(PoseTrack(), {}, device::GripMechanics{.hand = device::Hand::Free});
    rig.run_up();
    ASSERT_EQ(rig.tick.safety_state(), SafetyState::Running);
    rig.steps(2000);
    // Eight strings at minimum tension are a weak spring to the point where their pulls balance.
    EXPECT_LT(glm::length(rig.board.device().grip_pose().position), 0.02);
    EXPECT_EQ(rig.tick.faults(), 0U);
}

}  // namespace
}  // namespace haptic::rt
