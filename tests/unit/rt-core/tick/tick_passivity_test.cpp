// Passivity observer and controller in the tick.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <vector>

#include "tick_rig.hpp"

namespace haptic::rt {
namespace {

using test::floor_frame;
using test::TickRig;

/// Waits a second, then moves up and down between 0 and `low` as a sine of `hz`.
PoseTrack pumping_hand(double low, double hz) {
    std::vector<double> times{0.0};
    std::vector<Pose> poses{Pose{}};
    for (int i = 0; i <= 4000; ++i) {
        const double t = 1e-3 * i;
        times.push_back(1.0 + t);
        poses.push_back({{0.0, 0.5 * low * (1.0 - std::cos(2.0 * std::numbers::pi * hz * t)), 0.0}, Quat(1, 0, 0, 0)});
    }
    return {std::move(times), std::move(poses)};
}

TEST(TickPassivity, ObservesTheTrueWorkOfTheStrings) {
    // Oracle: the board's own tensions and poses.
    for (const int exchanges : {2, 1}) {
        TickSettings settings;
        settings.exchanges = exchanges;
        settings.passivity.control = PassivityControl::Observe;
        settings.passivity.damping = 0.0;
        settings.passivity.rotational_damping = 0.0;
        settings.passivity.store = 1.0;
        TickRig rig(pumping_hand(-0.02, 2.0), settings);
        rig.run_up();
        const auto press = [&rig] {
            rig.publish(floor_frame(0.005, 200.0, rig.now_ns));  // always in contact
            rig.step();
        };
        for (int i = 0; i < 500; ++i) {
            press();
        }
        const double before = rig.tick.last().energy;
        double work = 0.0;
        double least = 0.0;
        double most = 0.0;
        for (int i = 0; i < 1500; ++i) {
            const Vec3 from = rig.board.device().grip_pose().position;
            const Wrench at_from = rig.board.device().wrench();
            rig.board.device().advance(rig.now_ns);  // the motors still hold the last command
            const Vec3 way = rig.board.device().grip_pose().position - from;
            work -= 0.5 * glm::dot(at_from.force + rig.board.device().wrench().force, way);
            press();
            least = std::min(least, work);
            most = std::max(most, work);
            // The force is up to 5 N and the position is known to a few um at both ends; the error does not accumulate.
            ASSERT_NEAR(rig.tick.last().energy - before, work, 8e-5) << i << ", exchanges " << exchanges;
        }
        EXPECT_GT(most - least, 0.02);
    }
}

TEST(TickPassivity, MakesNoWrenchInFreeMotionAfterABoundedContact) {
    TickSettings settings;
    settings.passivity.damping = 0.0;  // no credit for the energy below
    TickRig rig(pumping_hand(-0.02, 2.0), settings);
    rig.run_up();
    // A floor that exists only while the hand moves up would give energy without having taken any.
    double last = 0.0;
    for (int i = 0; i < 1000; ++i) {
        const double height = rig.tick.last().pose.position.y;
        rig.publish(floor_frame(height > last ? -0.005 : -1.0, 500.0, rig.now_ns));
        last = height;
        rig.step();
    }
    EXPECT_GT(rig.tick.instruments().passivity_ticks, 100u);
    EXPECT_GT(rig.tick.instruments().min_energy, -1e-4);
    for (int i = 0; i < 1000; ++i) {
        rig.publish(floor_frame(-1.0, 500.0, rig.now_ns));
        rig.step();
        if (i > 10) {  // the rate limits have released the wrench
            ASSERT_EQ(rig.tick.last().rendered.force, Vec3(0.0)) << i;
            ASSERT_EQ(rig.tick.last().rendered.torque, Vec3(0.0)) << i;
            ASSERT_EQ(rig.tick.last().flags & HAPTIC_TICK_PASSIVITY_LIMITED, 0u) << i;
        }
    }
}

TEST(TickPassivity, ReportsALimitedStiffness) {
    TickSettings settings;
    settings.frames.max_stiffness = 600.0;
    TickRig rig(pumping_hand(-0.01, 1.0), settings);
    rig.run_up();
    for (int i = 0; i < 1100; ++i) {
        rig.publish(floor_frame(-0.005, 2000.0, rig.now_ns));
        rig.step();
    }
    EXPECT_NE(rig.tick.last().flags & HAPTIC_TICK_STIFFNESS_LIMITED, 0u);
    EXPECT_GT(rig.tick.instruments().stiffness_limited_ticks, 1000u);
    EXPECT_NEAR(rig.tick.instruments().peak_force, 600.0 * 0.005, 0.01);
    rig.publish(floor_frame(-0.005, 500.0, rig.now_ns));
    rig.step();
    EXPECT_EQ(rig.tick.last().flags & HAPTIC_TICK_STIFFNESS_LIMITED, 0u);
}

}  // namespace
}  // namespace haptic::rt
