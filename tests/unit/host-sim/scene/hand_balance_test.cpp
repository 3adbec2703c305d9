#include "scene/hand_balance.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <vector>

namespace haptic::sim {
namespace {

constexpr double kBalanceStep = 0.01;  // s
const WorkspaceSettings kMapping{.scale = 0.4, .force_scale = 4.0};

DeviceFeedback rendering(double stiffness, double scale, const Vec3& impulse = Vec3(0.0)) {
    return {.stiffness = stiffness, .scale = scale, .impulse = impulse};
}

TEST(HandBalance, WithoutADeviceTheBodiesReceiveTheWholeForce) {
    HandBalance balance;
    const Workspace workspace(kMapping);
    for (int i = 0; i < 3; ++i) {
        const HandBalance::Share share = balance.begin_step({}, workspace, 50.0, 0.7, kBalanceStep, 0);
        EXPECT_EQ(share.gain, 0.7);
        EXPECT_EQ(share.owed_force, Vec3(0.0));
        balance.end_step({0.0, 3.0, 0.0}, true, kBalanceStep);
    }
}

TEST(HandBalance, TakesTheStiffnessAndThePartThatTheDeviceRenders) {
    // 100 N/m at the device are 10 N/m in the scene.
    const Workspace workspace(kMapping);
    const auto gain = [&](double stiffness, double scale, double clutch) {
        return HandBalance().begin_step(rendering(stiffness, scale), workspace, 50.0, clutch, kBalanceStep, 0).gain;
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
        const HandBalance::Share share =
            balance.begin_step(rendering(1e4, 1.0, felt), workspace, 50.0, 1.0, kBalanceStep, 0);
        const Vec3 at_hand = (1.0 + 0.5 * std::sin(0.05 * i)) * Vec3(0.2, 1.0, 0.0);  // N
        const Vec3 force = 0.8 * at_hand / kMapping.force_scale + share.owed_force;
        balance.end_step(force, true, kBalanceStep);
        given += kBalanceStep * force;
        felt += kBalanceStep * at_hand;
        if (i > 20) {
            // What is still owed: the difference over the tenth of a second in which it is paid, and that of a step.
            const Vec3 owed = felt / kMapping.force_scale - given;
            EXPECT_LT(glm::length(owed), 1.5 * 0.2 * (0.1 + kBalanceStep) * glm::length(at_hand) / kMapping.force_scale)
                << i;
        }
    }
    // 0.2 times 0.1 s of 10 s.
    EXPECT_NEAR(glm::length(kMapping.force_scale * given) / glm::length(felt), 1.0, 0.003);
}

TEST(HandBalance, OwesWhatIsFeltFromTheOldSideOfATurningContact) {
    HandBalance balance;
    const Workspace workspace(kMapping);
    (void)balance.begin_step(rendering(1e4, 1.0), workspace, 50.0, 1.0, kBalanceStep, 0);
    balance.end_step({0.0, 1.0, 0.0}, true, kBalanceStep);
    const Vec3 felt = kBalanceStep * kMapping.force_scale * Vec3(1.0, 0.0, 0.0);  // N*s, device frame
    const Vec3 owed = balance.begin_step(rendering(1e4, 1.0, felt), workspace, 50.0, 1.0, kBalanceStep, 0).owed_force;
    // A tenth of the difference.
    EXPECT_NEAR(owed.x, 0.1, 1e-12);
    EXPECT_NEAR(owed.y, -0.1, 1e-12);
}

TEST(HandBalance, OwesWhatIsFeltFromAContactThatHasEnded) {
    HandBalance balance;
    const Workspace workspace(kMapping);
    Vec3 felt(0.0);  // N*s, device frame
    (void)balance.begin_step(rendering(1e4, 1.0, felt), workspace, 50.0, 1.0, kBalanceStep, 0);
    balance.end_step({0.0, 1.0, 0.0}, true, kBalanceStep);
    felt.y += kBalanceStep * kMapping.force_scale;
    // The hand's force ends within 50 ms; the bodies receive what is owed to them and nothing else.
    double given = kBalanceStep;  // N*s, scene
    for (int i = 0; i < 10; ++i) {
        felt.y += i < 5 ? 0.2 * (5 - i) * kBalanceStep * kMapping.force_scale : 0.0;
        const Vec3 owed =
            balance.begin_step(rendering(1e4, 1.0, felt), workspace, 50.0, 1.0, kBalanceStep, 0).owed_force;
        balance.end_step(owed, false, kBalanceStep);
        given += kBalanceStep * owed.y;
    }
    EXPECT_NEAR(kMapping.force_scale * given / felt.y, 1.0, 0.01);
}

TEST(HandBalance, OwesALateStepNoGreaterForce) {
    // The hand feels 1 N; the second step comes three steps late.
    HandBalance balance;
    const Workspace workspace(kMapping);
    (void)balance.begin_step(rendering(1e4, 1.0), workspace, 50.0, 1.0, kBalanceStep, 0);
    balance.end_step(Vec3(0.0, 1.0 / kMapping.force_scale, 0.0), true, kBalanceStep);
    const Vec3 felt(0.0, 4.0 * kBalanceStep, 0.0);  // N*s
    const HandBalance::Share share = balance.begin_step(rendering(1e4, 1.0, felt), workspace, 50.0, 1.0, kBalanceStep,
                                                        nanoseconds(4.0 * kBalanceStep));
    EXPECT_NEAR(share.hand_impulse.y, kBalanceStep, 1e-12);
    EXPECT_NEAR(share.owed_force.y, 0.0, 1e-12);
}

TEST(HandBalance, OwesNothingForWhatIsFeltInFreeAir) {
    HandBalance balance;
    const Workspace workspace(kMapping);
    Vec3 felt(0.0);
    (void)balance.begin_step(rendering(1e4, 1.0, felt), workspace, 50.0, 1.0, kBalanceStep, 0);
    balance.end_step({0.0, 1.0, 0.0}, true, kBalanceStep);
    for (int i = 0; i < 11; ++i) {
        (void)balance.begin_step(rendering(1e4, 1.0, felt), workspace, 50.0, 1.0, kBalanceStep, 0);
        balance.end_step(Vec3(0.0), false, kBalanceStep);
    }
    for (int i = 0; i < 100; ++i) {
        felt.y += 0.001;
        EXPECT_EQ(balance.begin_step(rendering(1e4, 1.0, felt), workspace, 50.0, 1.0, kBalanceStep, 0).owed_force,
                  Vec3(0.0));
        balance.end_step(Vec3(0.0), false, kBalanceStep);
    }
}

TEST(HandBalance, PaysAtTheSameRateWithAnyStep) {
    // The hand feels 1 N where the bodies get nothing, for as long as it takes to pay 1 - 1/e of it.
    const Workspace workspace(kMapping);
    const auto paid_after = [&](double step_s) {
        HandBalance balance;
        double impulse = 0.0;  // N*s, device frame
        double paid = 0.0;
        const int steps = static_cast<int>(std::lround(0.1 / step_s));
        for (int i = 0; i <= steps; ++i) {
            const Vec3 owed =
                balance.begin_step(rendering(1e4, 1.0, {0.0, impulse, 0.0}), workspace, 50.0, 1.0, step_s, 0)
                    .owed_force;
            balance.end_step(owed, true, step_s);
            impulse += step_s;
            paid += step_s * owed.y;
        }
        return kMapping.force_scale * paid / impulse;
    };
    const double fine = paid_after(0.0005);
    EXPECT_NEAR(fine, std::exp(-1.0), 0.01);  // of a force that lasts T: 1 - (1 - exp(-1))
    for (const double step_s : {0.001, 0.002, 0.005, 0.01}) {
        EXPECT_NEAR(paid_after(step_s), fine, 10.0 * step_s * fine) << step_s;
    }
}

TEST(HandBalance, PaysAfterAContactWithoutAKick) {
    // The hand feels 1 N where the contact gives 0.8 N; then it is lost for a step.
    constexpr double kShort = 0.002;  // s
    HandBalance balance;
    const Workspace workspace(kMapping);
    double felt = 0.0;  // N*s, device frame
    double owed = 0.0;  // N, at the hand
    for (int i = 0; i < 200; ++i) {
        owed = kMapping.force_scale *
               balance.begin_step(rendering(1e4, 1.0, {0.0, felt, 0.0}), workspace, 50.0, 1.0, kShort, 0).owed_force.y;
        balance.end_step({0.0, i < 199 ? (0.8 + owed) / kMapping.force_scale : 0.0, 0.0}, i < 199, kShort);
        felt += kShort;
    }
    EXPECT_NEAR(owed, 0.2, 0.01);
    owed = kMapping.force_scale *
           balance.begin_step(rendering(1e4, 1.0, {0.0, felt, 0.0}), workspace, 50.0, 1.0, kShort, 0).owed_force.y;
    // A debt of 0.1 s of 0.2 N, paid in 0.02 s.
    EXPECT_LT(owed, 1.2);
}

// A body on a spring to the hand, which feels the spring's force 30 ms later, is no more set swinging by its balance
// than the spring's damping takes away.
TEST(HandBalance, KeepsABodyStillThoughItsForceIsFeltLate) {
    constexpr double kShort = 0.002;            // s
    constexpr std::size_t kLate = 15;           // steps
    constexpr double kMass = 0.15;              // kg
    constexpr double kSpringStiffness = 750.0;  // N/m, scene
    constexpr double kDampingTime = 0.004;      // s
    HandBalance balance;
    const Workspace workspace(kMapping);
    std::vector<double> felt(kLate + 1, 0.0);  // N*s, device frame, oldest first
    double position = 0.001;                   // m, from where the spring rests
    double velocity = 0.0;
    double largest = 0.0;
    for (int i = 0; i < 1000; ++i) {
        const Vec3 owed =
            balance
                .begin_step(rendering(1e5, 1.0, {0.0, felt.front(), 0.0}), workspace, kSpringStiffness, 1.0, kShort, 0)
                .owed_force;
        const double contact = kSpringStiffness * (position + kDampingTime * velocity);  // on the hand
        const double force = contact + owed.y;
        velocity -= kShort * force / kMass;
        position += kShort * velocity;
        balance.end_step({0.0, force, 0.0}, true, kShort);
        felt.push_back(felt.back() + kShort * kMapping.force_scale * contact);
        felt.erase(felt.begin());
        largest = i < 500 ? 0.0 : std::max(largest, std::fabs(position));
    }
    EXPECT_LT(largest, 2e-5) << "m, in the second second";
}

}  // namespace
}  // namespace haptic::sim
