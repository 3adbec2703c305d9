#include "scene/hand_balance.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

namespace haptic::sim {
namespace {

constexpr double kStep = 0.01;  // s
const WorkspaceSettings kMapping{.scale = 0.4, .force_scale = 4.0};

DeviceFeedback rendering(double stiffness, double scale, const Vec3& impulse = Vec3(0.0)) {
    return {.stiffness = stiffness, .scale = scale, .impulse = impulse};
}

TEST(HandBalance, WithoutADeviceTheBodiesReceiveTheWholeForce) {
    HandBalance balance;
    const Workspace workspace(kMapping);
    for (int i = 0; i < 3; ++i) {
        const HandBalance::Share share = balance.begin_step({}, workspace, 50.0, 0.7, kStep, 0);
        EXPECT_EQ(share.gain, 0.7);
        EXPECT_EQ(share.owed_force, Vec3(0.0));
        balance.end_step({0.0, 3.0, 0.0}, true, kStep);
    }
}

TEST(HandBalance, TakesTheStiffnessAndThePartThatTheDeviceRenders) {
    // 100 N/m at the device are 10 N/m in the scene.
    const Workspace workspace(kMapping);
    const auto gain = [&](double stiffness, double scale, double clutch) {
        return HandBalance().begin_step(rendering(stiffness, scale), workspace, 50.0, clutch, kStep, 0).gain;
    };
    EXPECT_NEAR(gain(100.0, 1.0, 1.0), 0.2, 1e-15);
    EXPECT_NEAR(gain(100.0, 0.5, 1.0), 0.1, 1e-15);
    EXPECT_NEAR(gain(100.0, 1.0, 0.1), 0.1, 1e-15) << "the clutch allows less";
    EXPECT_NEAR(gain(5000.0, 1.0, 1.0), 1.0, 1e-15) << "not more than the scene asks for";
    EXPECT_EQ(gain(0.0, 0.0, 1.0), 0.0);
}

TEST(HandBalance, BodiesReceiveWhatTheHandFeelsThoughTheirContactGivesLess) {
    // The contact gives four fifths of what the hand feels, which varies; the rest is paid.
    HandBalance balance;
    const Workspace workspace(kMapping);
    Vec3 felt(0.0);   // N*s, device frame
    Vec3 given(0.0);  // N*s, scene
    for (int i = 0; i < 1000; ++i) {
        const HandBalance::Share share = balance.begin_step(rendering(1e4, 1.0, felt), workspace, 50.0, 1.0, kStep, 0);
        const Vec3 at_hand = (1.0 + 0.5 * std::sin(0.05 * i)) * Vec3(0.2, 1.0, 0.0);  // N
        const Vec3 force = 0.8 * at_hand / kMapping.force_scale + share.owed_force;
        balance.end_step(force, true, kStep);
        given += kStep * force;
        felt += kStep * at_hand;
        if (i > 20) {
            // What is still owed: twice the difference of a step.
            const Vec3 owed = felt / kMapping.force_scale - given;
            EXPECT_LT(glm::length(owed), 3.0 * 0.2 * kStep * glm::length(at_hand) / kMapping.force_scale) << i;
        }
    }
    EXPECT_NEAR(glm::length(kMapping.force_scale * given) / glm::length(felt), 1.0, 0.001);
}

TEST(HandBalance, OwesWhatIsFeltFromTheOldSideOfATurningContact) {
    HandBalance balance;
    const Workspace workspace(kMapping);
    (void)balance.begin_step(rendering(1e4, 1.0), workspace, 50.0, 1.0, kStep, 0);
    balance.end_step({0.0, 1.0, 0.0}, true, kStep);
    const Vec3 felt = kStep * kMapping.force_scale * Vec3(1.0, 0.0, 0.0);  // N*s, device frame
    const Vec3 owed = balance.begin_step(rendering(1e4, 1.0, felt), workspace, 50.0, 1.0, kStep, 0).owed_force;
    // Half of the difference.
    EXPECT_NEAR(owed.x, 0.5, 1e-12);
    EXPECT_NEAR(owed.y, -0.5, 1e-12);
}

TEST(HandBalance, OwesWhatIsFeltFromAContactThatHasEnded) {
    HandBalance balance;
    const Workspace workspace(kMapping);
    Vec3 felt(0.0);  // N*s, device frame
    (void)balance.begin_step(rendering(1e4, 1.0, felt), workspace, 50.0, 1.0, kStep, 0);
    balance.end_step({0.0, 1.0, 0.0}, true, kStep);
    felt.y += kStep * kMapping.force_scale;
    // The hand's force ends within 50 ms; the bodies receive what is owed to them and nothing else.
    double given = kStep;  // N*s, scene
    for (int i = 0; i < 10; ++i) {
        felt.y += i < 5 ? 0.2 * (5 - i) * kStep * kMapping.force_scale : 0.0;
        const Vec3 owed = balance.begin_step(rendering(1e4, 1.0, felt), workspace, 50.0, 1.0, kStep, 0).owed_force;
        balance.end_step(owed, false, kStep);
        given += kStep * owed.y;
    }
    EXPECT_NEAR(kMapping.force_scale * given / felt.y, 1.0, 0.01);
}

TEST(HandBalance, OwesALateStepNoGreaterForce) {
    // The hand feels 1 N; the second step comes three steps late.
    HandBalance balance;
    const Workspace workspace(kMapping);
    (void)balance.begin_step(rendering(1e4, 1.0), workspace, 50.0, 1.0, kStep, 0);
    balance.end_step(Vec3(0.0, 1.0 / kMapping.force_scale, 0.0), true, kStep);
    const Vec3 felt(0.0, 4.0 * kStep, 0.0);  // N*s
    const HandBalance::Share share =
        balance.begin_step(rendering(1e4, 1.0, felt), workspace, 50.0, 1.0, kStep, nanoseconds(4.0 * kStep));
    EXPECT_NEAR(share.hand_impulse.y, kStep, 1e-12);
    EXPECT_NEAR(share.owed_force.y, 0.0, 1e-12);
}

TEST(HandBalance, OwesNothingForWhatIsFeltInFreeAir) {
    HandBalance balance;
    const Workspace workspace(kMapping);
    Vec3 felt(0.0);
    (void)balance.begin_step(rendering(1e4, 1.0, felt), workspace, 50.0, 1.0, kStep, 0);
    balance.end_step({0.0, 1.0, 0.0}, true, kStep);
    for (int i = 0; i < 11; ++i) {
        (void)balance.begin_step(rendering(1e4, 1.0, felt), workspace, 50.0, 1.0, kStep, 0);
        balance.end_step(Vec3(0.0), false, kStep);
    }
    for (int i = 0; i < 100; ++i) {
        felt.y += 0.001;
        EXPECT_EQ(balance.begin_step(rendering(1e4, 1.0, felt), workspace, 50.0, 1.0, kStep, 0).owed_force, Vec3(0.0));
        balance.end_step(Vec3(0.0), false, kStep);
    }
}

}  // namespace
}  // namespace haptic::sim
