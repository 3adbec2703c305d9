// The session's budget and the walls of the workspace, in the tick.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "haptic/device/grip_mechanics.hpp"
#include "process/force_profiles.hpp"
#include "tick_rig.hpp"

namespace haptic::rt {
namespace {

using test::floor_frame;
using test::TickRig;

const Quat kLevel(1.0, 0.0, 0.0, 0.0);
constexpr double kFloor = 300.0;  // N/m

/// Pushes down by 8 mm and comes back, once a second from 2 s on.
PoseTrack hand_that_presses(int times) {
    std::vector<double> at_s = {0.0, 2.0};
    std::vector<Pose> poses = {Pose{}, Pose{}};
    for (int k = 0; k < times; ++k) {
        at_s.insert(at_s.end(), {2.5 + k, 3.0 + k});
        poses.insert(poses.end(), {Pose{{0.0, -0.008, 0.0}, kLevel}, Pose{}});
    }
    return {at_s, poses};
}

TickSettings with_budget(const BudgetLimits& budget) {
    TickSettings settings;
    settings.budget = budget;
    return settings;
}

TickSettings with_walls() {
    TickSettings settings;
    settings.frames.max_stiffness = 600.0;
    settings.frames.max_rotational_stiffness = 0.12;
    apply_profile(Config{}, normal_profile(), settings);
    settings.budget = {};
    return settings;
}

TEST(BudgetInTheTick, EndsASessionThatHasGivenItsEnergyInABoundedFade) {
    // The floor gives back k d^2 / 2 = 9.6 mJ each time; 15 mJ are spent on the second way up.
    TickRig rig(hand_that_presses(3), with_budget({.session = 0.015}));
    rig.run_up();
    ASSERT_EQ(rig.tick.safety_state(), SafetyState::Running);
    std::int64_t warned_ns = 0;
    std::int64_t faulted_ns = 0;
    double given = 0.0;
    Pose before = rig.tick.last().pose;
    Wrench held = rig.tick.last().made;
    while (rig.now_ns < 6'000'000'000 && rig.tick.safety_state() != SafetyState::Disarmed) {
        rig.publish(floor_frame(0.0, kFloor, rig.now_ns));
        rig.step();
        const TickRecord& record = rig.tick.last();
        // The oracle: force times displacement, from the record.
        given += std::max(0.0, glm::dot(held.force, record.pose.position - before.position));
        ASSERT_LE(glm::length(record.made.force - held.force),
                  rig.settings.limits.force_rate * 1e-3 + 0.06);  // eight DAC codes
        before = record.pose;
        held = record.made;
        warned_ns = (record.flags & HAPTIC_TICK_BUDGET_LOW) != 0 && warned_ns == 0 ? record.now_ns : warned_ns;
        if (record.faults != 0 && faulted_ns == 0) {
            faulted_ns = record.now_ns;
            EXPECT_NEAR(given, 0.015, 5e-4);
        }
    }
    EXPECT_EQ(rig.tick.faults(), static_cast<std::uint32_t>(HAPTIC_FAULT_BUDGET));
    EXPECT_GT(warned_ns, 0);
    EXPECT_LT(warned_ns, faulted_ns);
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Disarmed);
    EXPECT_NEAR(static_cast<double>(faulted_ns) * 1e-9, 4.7, 0.3) << "on the second way up";
    EXPECT_EQ(rig.tick.last().made.force, Vec3(0.0));
    EXPECT_LT(given, 0.017) << "the fade: 1.2 N over 1.6 mm at most";
}

TEST(BudgetInTheTick, EndsASessionAfterItsTime) {
    TickRig rig(PoseTrack(), with_budget({.duration = 0.5}));
    rig.run_up();
    ASSERT_EQ(rig.tick.safety_state(), SafetyState::Running);
    rig.steps(350);
    EXPECT_EQ(rig.tick.faults(), 0U);
    rig.steps(200);
    EXPECT_EQ(rig.tick.faults(), static_cast<std::uint32_t>(HAPTIC_FAULT_BUDGET));
    // Arming again does not renew it.
    rig.steps(1000);
    rig.tick.arm();
    rig.steps(2);
    EXPECT_EQ(rig.tick.faults(), static_cast<std::uint32_t>(HAPTIC_FAULT_BUDGET));
}

/// To the right by 25 mm and back within two seconds.
PoseTrack hand_that_goes_right() {
    return {{0.0, 2.0, 3.0, 4.0}, {Pose{}, Pose{}, Pose{{0.025, 0.0, 0.0}, kLevel}, Pose{}}};
}

TEST(WallsInTheTick, PushBackBeyondTheRegionOnlyAndGiveNoEnergy) {
    TickRig rig(hand_that_goes_right(), with_walls());
    ASSERT_TRUE(rig.settings.walls.on);
    rig.run_up();
    const double edge = rig.settings.walls.semi_axes.x;
    double work = 0.0;
    double largest = 0.0;
    Vec3 rendered(0.0);
    Vec3 before = rig.tick.last().pose.position;
    while (rig.now_ns < 5'500'000'000) {
        rig.step();
        const TickRecord& record = rig.tick.last();
        work += glm::dot(rendered, record.pose.position - before);
        before = record.pose.position;
        rendered = record.rendered.force;
        const bool outside = record.pose.position.x > edge + 1e-4;
        if (record.pose.position.x < edge - 1e-4) {
            ASSERT_EQ(rendered, Vec3(0.0)) << "free motion";
            ASSERT_EQ(record.flags & HAPTIC_TICK_WORKSPACE_EDGE, 0U);
        } else if (outside) {
            ASSERT_LT(rendered.x, 0.0);
            ASSERT_NE(record.flags & HAPTIC_TICK_WORKSPACE_EDGE, 0U);
        }
        largest = std::max(largest, glm::length(rendered));
    }
    EXPECT_GT(largest, 0.9 * rig.settings.walls.force);
    EXPECT_LE(largest, 2.0 * rig.settings.walls.force);
    EXPECT_LT(work, 0.0) << "the damping takes energy, and the spring gives back what it took";
    EXPECT_EQ(rig.tick.faults(), 0U);
    // The walls are no contact of the simulation's bodies.
    DeviceState state{};
    ASSERT_TRUE(rig.states_in.read_newest(state));
    EXPECT_EQ(glm::length(Vec3(state.impulse[0], state.impulse[1], state.impulse[2])), 0.0);
}

TEST(WallsInTheTick, HoldACompliantHandStillEvenOnAFloor) {
    // Against wall and floor at once, both near their limits of stiffness.
    const PoseTrack hand = {{0.0, 2.0, 2.5}, {Pose{}, Pose{}, Pose{{0.022, -0.006, 0.0}, kLevel}}};
    TickRig rig(hand, with_walls(), device::GripMechanics{});
    rig.run_up();
    ASSERT_EQ(rig.tick.safety_state(), SafetyState::Running);
    double fastest = 0.0;
    while (rig.now_ns < 6'000'000'000) {
        rig.publish(floor_frame(0.0, kFloor, rig.now_ns));
        rig.step();
        if (rig.now_ns > 5'000'000'000) {
            fastest = std::max(fastest, glm::length(rig.board.device().grip_velocity().linear));
        }
    }
    EXPECT_LT(fastest, 2e-3) << "m/s";
    EXPECT_NE(rig.tick.last().flags & HAPTIC_TICK_WORKSPACE_EDGE, 0U);
    EXPECT_EQ(rig.tick.faults(), 0U);
    // The bodies get the floor's share alone: upwards, and next to nothing from the side.
    DeviceState state{};
    ASSERT_TRUE(rig.states_in.read_newest(state));
    EXPECT_GT(state.impulse[1], 1.0);
    EXPECT_LT(std::fabs(state.impulse[0]), 0.1 * state.impulse[1]);
}

}  // namespace
}  // namespace haptic::rt
