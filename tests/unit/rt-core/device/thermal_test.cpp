#include "device/thermal.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <stdexcept>

#include "random.hpp"
#include "tick_rig.hpp"
#include "units.hpp"

namespace haptic::rt {
namespace {

using test::kTickNs;

constexpr double kContinuous = 10.0;  // N
constexpr double kTau = 20.0;         // s

ThermalSettings ratings() {
    ThermalSettings settings;
    settings.motors.fill({kContinuous, kTau});
    settings.minimum = 0.3;
    settings.maximum = 20.0;
    return settings;
}

StringArray all(double tension) {
    StringArray tensions{};
    tensions.fill(tension);
    return tensions;
}

TEST(ThermalModel, FollowsTheClosedFormOfTheFirstOrderModel) {
    // u^2 (1 - exp(-t / tau)) from cold, then the same towards another tension; each motor with its own rating.
    ThermalSettings settings = ratings();
    for (std::size_t i = 0; i < kStrings; ++i) {
        settings.motors[i] = {5.0 + static_cast<double>(i), 3.0 + 2.0 * static_cast<double>(i)};
    }
    ThermalModel model(settings);
    for (int tick = 0; tick < 4000; ++tick) {
        model.update(all(8.0), kTickNs);
    }
    for (int tick = 0; tick < 3000; ++tick) {
        model.update(all(2.0), kTickNs);
    }
    for (std::size_t i = 0; i < kStrings; ++i) {
        const double c = 5.0 + static_cast<double>(i);
        const double tau = 3.0 + 2.0 * static_cast<double>(i);
        const double warm = 64.0 / (c * c) * -std::expm1(-4.0 / tau);
        const double settled = 4.0 / (c * c);
        EXPECT_NEAR(model.loads()[i], settled + (warm - settled) * std::exp(-3.0 / tau), 1e-12) << i;
    }
}

TEST(ThermalModel, GivesTheSameLoadForOneLongStepAsForManyShortOnes) {
    ThermalModel fine(ratings());
    ThermalModel coarse(ratings());
    for (int tick = 0; tick < 5000; ++tick) {
        fine.update(all(13.0), kTickNs);
    }
    coarse.update(all(13.0), 5000 * kTickNs);
    EXPECT_NEAR(fine.loads()[3], coarse.loads()[3], 1e-12);
}

TEST(ThermalModel, ReachesLoadOneAfterTheTimeOfTheFormula) {
    // tau ln(u^2 / (u^2 - 1)) at u = 2.
    const double expected_s = kTau * std::log(4.0 / 3.0);
    ThermalModel model(ratings());
    std::int64_t time_ns = 0;
    while (!model.overheated()) {
        model.update(all(2.0 * kContinuous), kTickNs);
        time_ns += kTickNs;
    }
    EXPECT_NEAR(seconds(time_ns), expected_s, 1e-3);
}

TEST(ThermalModel, HoldsItsContinuousTensionIndefinitely) {
    ThermalModel model(ratings());
    model.update(all(0.999 * kContinuous), 24 * 3600 * kNanosecondsPerSecond);
    EXPECT_FALSE(model.overheated());
}

TEST(ThermalModel, LowersItsBoundsSmoothlyAndNeverBelowTheMinimum) {
    ThermalSettings settings = ratings();
    settings.motors[0].continuous = 0.37;
    ThermalModel model(settings);
    EXPECT_EQ(model.bounds(), all(settings.maximum));
    StringArray last = model.bounds();
    for (int tick = 0; tick < 20'000; ++tick) {
        model.update(all(15.0), kTickNs);
        const StringArray now = model.bounds();
        for (std::size_t i = 0; i < kStrings; ++i) {
            ASSERT_LE(now[i], last[i]);
            ASSERT_GE(now[i], settings.minimum);
            // The load rises by at most (t / c)^2 / tau, and the steepest slope of the bound is 1.5 times its range.
            const double c = settings.motors[i].continuous;
            const double rise = 225.0 / (c * c) / kTau * 1e-3;
            ASSERT_LE(last[i] - now[i], 1.5 * settings.maximum * rise / (1.0 - settings.derate_from));
        }
        last = now;
    }
    EXPECT_NEAR(last[0], 0.9 * 0.37, 1e-9);
    EXPECT_NEAR(last[1], 0.9 * kContinuous, 1e-9);
}

TEST(ThermalModel, NeverOverheatsWithinItsBounds) {
    test::Random random(3);
    for (const double derate_from : {0.0, 0.3, 0.7, 0.99}) {
        ThermalSettings settings = ratings();
        settings.derate_from = derate_from;
        ThermalModel model(settings);
        StringArray wanted = all(20.0);
        for (int tick = 0; tick < 200'000; ++tick) {
            if (tick % 1000 == 0 && tick > 100'000) {
                wanted = all(random.uniform(0.0, 20.0));
            }
            const StringArray bounds = model.bounds();
            StringArray sent{};
            for (std::size_t i = 0; i < kStrings; ++i) {
                sent[i] = std::min(wanted[i], bounds[i]);
            }
            model.update(sent, kTickNs);
            ASSERT_FALSE(model.overheated()) << derate_from << ", tick " << tick;
        }
    }
}

TEST(ThermalModel, RejectsInvalidRatings) {
    const auto refuses = [](void (*spoil)(ThermalSettings&)) {
        ThermalSettings settings = ratings();
        spoil(settings);
        EXPECT_THROW(const ThermalModel model(settings), std::invalid_argument);
    };
    refuses([](ThermalSettings& s) { s.motors[2].time_constant_s = 0.0; });
    refuses([](ThermalSettings& s) { s.motors[7].continuous = 0.3; });
    refuses([](ThermalSettings& s) { s.derate_from = 1.0; });
}

/// Motors that warm up in a second and have low ratings, so that a test takes seconds instead of minutes.
TickSettings quick_motors() {
    TickSettings settings;
    settings.motors.continuous_share = 0.1;
    settings.motors.time_constant_s = 0.5;
    // The passivity controller would not let a floor that jumps under a resting hand push with 8 N.
    settings.passivity.control = PassivityControl::Observe;
    return settings;
}

TEST(TickThermal, DeratesWarmMotorsAndKeepsRunning) {
    test::TickRig rig(PoseTrack(), quick_motors());
    rig.run_up();
    double least = 8.0;
    for (int i = 0; i < 5000; ++i) {
        rig.publish(test::floor_frame(0.05, 1000.0, rig.now_ns));  // 8 N, the force limit
        rig.step();
        least = i > 3000 ? std::min(least, rig.board.device().wrench().force.y) : least;
        for (const double tension : rig.board.device().tensions()) {
            ASSERT_GE(tension, 0.29);
        }
    }
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Running);
    EXPECT_NE(rig.tick.last().flags & HAPTIC_TICK_DERATED, 0u);
    EXPECT_GT(rig.tick.instruments().derated_ticks, 1000u);
    const StringArray& loads = rig.tick.instruments().peak_motor_load;
    EXPECT_GT(*std::max_element(loads.begin(), loads.end()), 0.7);
    EXPECT_LT(*std::max_element(loads.begin(), loads.end()), 1.0);
    // Four strings pull up with at most 1.8 to 2 N each: less force than requested, but not zero.
    EXPECT_GT(least, 3.0);
    EXPECT_LT(least, 7.5);
}

TEST(TickThermal, FaultsWhenTheMotorsKeepPullingDespiteDerating) {
    TickSettings settings = quick_motors();
    settings.safety.exchange_share = 1.0;
    settings.safety.encoder_age_ns = 100'000'000'000;  // no exchange fault comes first
    test::TickRig rig(PoseTrack(), settings);
    rig.run_up();
    for (int i = 0; i < 100; ++i) {
        rig.publish(test::floor_frame(0.05, 1000.0, rig.now_ns));
        rig.step();
    }
    ASSERT_EQ(rig.tick.safety_state(), SafetyState::Running);
    rig.faulty.failing = true;  // the motors hold their last command
    rig.steps(1000);
    EXPECT_EQ(rig.tick.faults(), static_cast<std::uint32_t>(HAPTIC_FAULT_THERMAL));
}

TEST(TickThermal, CountsTheTimeForWhichTheProcessWasStopped) {
    test::TickRig rig(PoseTrack(), quick_motors());
    rig.run_up();
    for (int i = 0; i < 50; ++i) {
        rig.publish(test::floor_frame(0.05, 1000.0, rig.now_ns));
        rig.step();
    }
    ASSERT_EQ(rig.tick.safety_state(), SafetyState::Running);
    rig.now_ns += 10 * kNanosecondsPerSecond;
    rig.step();
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Faulted);
    EXPECT_EQ(rig.tick.faults(), static_cast<std::uint32_t>(HAPTIC_FAULT_THERMAL));
}

}  // namespace
}  // namespace haptic::rt
