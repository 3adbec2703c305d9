#include "measure/stability.hpp"

#include <gtest/gtest.h>

#include "rendering/passivity.hpp"

namespace haptic::rt {

namespace {

constexpr std::int64_t kTickNs = 1'000'000;
constexpr double kFloor_j = -1e-4;  // J, lowest admissible energy of the observer
constexpr double kDamping = 0.3;    // N s/m, of the emulated grip
constexpr double kPeriod_s = 0.001;

StabilityTrial trial(DelayedPart late, double stiffness, int delay_ticks, PassivityControl control) {
    StabilityTrial trial;
    trial.late = late;
    trial.stiffness = stiffness;
    trial.delay_ns = delay_ticks * kTickNs;
    trial.duration_s = 1.6;
    trial.tick.passivity.control = control;
    return trial;
}

double passive_up_to(int delay_ticks) {
    return passive_stiffness(kDamping, 0.0, 0.0, kPeriod_s, delay_ticks * kPeriod_s);
}

TEST(Stability, OfAnUncontrolledWallEndsAtThePassiveStiffness) {
    for (const int delay : {0, 1, 5, 20}) {
        const double border = passive_up_to(delay);
        EXPECT_FALSE(
            run_stability_trial(trial(DelayedPart::Force, 0.5 * border, delay, PassivityControl::Observe)).grows)
            << delay << " ms";
        EXPECT_TRUE(
            run_stability_trial(trial(DelayedPart::Force, 2.5 * border, delay, PassivityControl::Observe)).grows)
            << delay << " ms";
    }
}

TEST(Stability, OfAStaticPlaneDoesNotDependOnItsAge) {
    const StabilityOutcome now = run_stability_trial(trial(DelayedPart::Planes, 400.0, 0, PassivityControl::Observe));
    const StabilityOutcome late = run_stability_trial(trial(DelayedPart::Planes, 400.0, 20, PassivityControl::Observe));
    EXPECT_EQ(now.last_amplitude, late.last_amplitude);
    EXPECT_EQ(now.min_energy, late.min_energy);
    EXPECT_FALSE(now.grows);
}

TEST(Stability, IsMaintainedByTheControllerForEveryStiffnessAndDelay) {
    for (const DelayedPart late : kDelayedParts) {
        for (const double stiffness : {10.0, 60.0, 300.0, 600.0, 2000.0}) {
            for (const int delay : {0, 2, 8, 20}) {
                if (late == DelayedPart::Planes && delay > 0) {
                    continue;  // same as without a delay
                }
                const StabilityOutcome outcome =
                    run_stability_trial(trial(late, stiffness, delay, PassivityControl::Bound));
                EXPECT_FALSE(outcome.grows)
                    << name_of(late) << ", " << stiffness << " N/m, " << delay << " ms: " << outcome.first_amplitude
                    << " to " << outcome.last_amplitude << " m";
                EXPECT_GE(outcome.min_energy, kFloor_j) << name_of(late) << ", " << stiffness << ", " << delay;
            }
        }
    }
}

TEST(Stability, GeneratesNoEnergyUpToThePassiveStiffness) {
    for (const double stiffness : {10.0, 100.0, 300.0, 600.0}) {
        const StabilityOutcome outcome =
            run_stability_trial(trial(DelayedPart::Planes, stiffness, 20, PassivityControl::Observe));
        EXPECT_GE(outcome.min_energy, kFloor_j) << stiffness;
        EXPECT_FALSE(outcome.grows) << stiffness;
    }
    for (const int delay : {1, 4, 20}) {
        const StabilityOutcome outcome =
            run_stability_trial(trial(DelayedPart::Force, passive_up_to(delay), delay, PassivityControl::Observe));
        EXPECT_GE(outcome.min_energy, kFloor_j) << delay << " ms";
    }
    EXPECT_LT(run_stability_trial(trial(DelayedPart::Planes, 2000.0, 0, PassivityControl::Observe)).min_energy,
              10 * kFloor_j);
}

TEST(Stability, IsMaintainedByTheStiffnessLimitAlone) {
    for (const double stiffness : {1000.0, 2000.0}) {
        StabilityTrial limited = trial(DelayedPart::Planes, stiffness, 20, PassivityControl::Observe);
        limited.tick.frames.max_stiffness = passive_up_to(0);
        const StabilityOutcome outcome = run_stability_trial(limited);
        EXPECT_GE(outcome.min_energy, kFloor_j);
        EXPECT_FALSE(outcome.grows);
    }
    StabilityTrial late = trial(DelayedPart::Force, 2000.0, 10, PassivityControl::Observe);
    late.tick.frames.max_stiffness = passive_up_to(10);
    EXPECT_FALSE(run_stability_trial(late).grows);
}

TEST(Stability, OfAHeldGripNeedsNoControllerBelowHalfOfThePassiveStiffness) {
    for (const double stiffness : {20.0, 100.0, 300.0}) {
        StabilityTrial held = trial(DelayedPart::Planes, stiffness, 0, PassivityControl::Bound);
        held.mechanics = device::GripMechanics{};  // a hand of 400 N/m and 4 N s/m, motors with friction
        const StabilityOutcome outcome = run_stability_trial(held);
        EXPECT_EQ(outcome.controlled, 0.0) << stiffness;
        EXPECT_LT(outcome.last_amplitude, 1e-4) << stiffness;
    }
}

}  // namespace
}  // namespace haptic::rt
