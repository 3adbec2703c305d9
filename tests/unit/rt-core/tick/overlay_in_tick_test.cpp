// The wrench overlay in the tick: what it may do to the hand, and what it must not do to the contact.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <optional>
#include <vector>

#include "haptic/device/grip_mechanics.hpp"
#include "process/force_profiles.hpp"
#include "tick_rig.hpp"
#include "units.hpp"

namespace haptic::rt {
namespace {

using test::floor_frame;
using test::kDacCodeN;
using test::TickRig;

const Quat kUpright(1.0, 0.0, 0.0, 0.0);
constexpr double kFloorStiffness = 300.0;  // N/m
// N; eight codes are rounded, and strings do not pull in one direction.
constexpr double kCodes = 8.0 * kDacCodeN;

TickSettings with_overlay(double max_force = 1.0, double max_torque = 0.02) {
    TickSettings settings;
    settings.overlay.max_force = max_force;
    settings.overlay.max_torque = max_torque;
    return settings;
}

/// A rig whose tick takes overlays from the session's ring.
class OverlayRig : public TickRig {
  public:
    explicit OverlayRig(const TickSettings& tick_settings, PoseTrack hand = PoseTrack(),
                        const std::optional<device::GripMechanics>& mechanics = {})
        : TickRig(std::move(hand), tick_settings, mechanics),
          overlays_in_(session),
          overlays_(overlays_in_),
          overlays_out_(session) {
        tick.overlay_from(&overlays_);
    }
    void push(const Vec3& force, const Vec3& torque = Vec3(0.0)) {
        WrenchOverlay overlay{};
        overlay.arrival_time_ns = now_ns;
        store(force, overlay.force);
        store(torque, overlay.torque);
        overlays_out_.publish(overlay, now_ns);
    }
    DeviceState state() {
        DeviceState newest{};
        EXPECT_TRUE(states_in.read_newest(newest));
        return newest;
    }

  private:
    RingReader<WrenchOverlay> overlays_in_;
    RingOverlays overlays_;
    RingWriter<WrenchOverlay> overlays_out_;
};

/// Presses 8 mm deep, comes back, and presses again, with some way to the side.
PoseTrack hand_that_presses_twice() {
    return {{0.0, 1.2, 1.7, 2.2, 2.7, 3.2},
            {Pose{}, Pose{}, Pose{{0.004, -0.008, 0.0}, kUpright}, Pose{}, Pose{{-0.003, -0.006, 0.002}, kUpright},
             Pose{}}};
}

TEST(OverlayInTheTick, IsNotTakenByDefault) {
    OverlayRig rig{TickSettings{}};
    rig.run_up();
    for (int i = 0; i < 300; ++i) {
        rig.push({5.0, 0.0, 0.0}, {0.1, 0.0, 0.0});
        rig.step();
        ASSERT_EQ(rig.tick.last().overlay_read, kNoOverlay);
        ASSERT_EQ(rig.tick.last().rendered.force, Vec3(0.0));
        ASSERT_EQ(rig.tick.last().rendered.torque, Vec3(0.0));
        ASSERT_EQ(rig.tick.last().flags & HAPTIC_TICK_OVERLAY, 0u);
    }
}

TEST(OverlayInTheTick, PushesTheHandInItsDirectionAndWithinItsBounds) {
    OverlayRig rig(with_overlay());
    rig.run_up();
    const Vec3 direction = glm::normalize(Vec3(2, -1, 1));
    Wrench before;
    for (int i = 0; i < 300; ++i) {
        rig.push(20.0 * direction, -2.0 * direction);
        rig.step();
        const Wrench& rendered = rig.tick.last().rendered;
        ASSERT_LE(glm::length(rendered.force - before.force), 1.0 / 0.1 * 1e-3 + 1e-12);
        before = rendered;
    }
    const TickRecord& record = rig.tick.last();
    EXPECT_LT(glm::length(record.rendered.force - direction), 1e-9);
    EXPECT_LT(glm::length(record.rendered.torque + 0.02 * direction), 1e-9);
    EXPECT_LT(glm::length(record.made.force - direction), kCodes) << "the strings make it";
    EXPECT_NE(record.flags & HAPTIC_TICK_OVERLAY, 0u);
    EXPECT_EQ(record.overlay_read, kOverlayAccepted);
    EXPECT_GT(rig.tick.instruments().overlay_ticks, 290u);
}

TEST(OverlayInTheTick, FadesWhenItsSenderFallsSilent) {
    OverlayRig rig(with_overlay());
    rig.run_up();
    for (int i = 0; i < 200; ++i) {
        rig.push({0.0, 0.0, 1.0});
        rig.step();
    }
    ASSERT_NEAR(rig.tick.last().rendered.force.z, 1.0, 1e-12);
    rig.steps(50);
    EXPECT_NEAR(rig.tick.last().rendered.force.z, 1.0, 1e-12) << "the timeout";
    rig.steps(50);
    EXPECT_NEAR(rig.tick.last().rendered.force.z, 0.5, 0.011) << "half of the ramp";
    rig.steps(52);
    EXPECT_EQ(rig.tick.last().rendered.force, Vec3(0.0));
    EXPECT_EQ(rig.tick.last().flags & HAPTIC_TICK_OVERLAY, 0u);
}

TEST(OverlayInTheTick, IsRefusedWithoutAFaultIfItIsNotFinite) {
    OverlayRig rig(with_overlay());
    rig.run_up();
    for (int i = 0; i < 200; ++i) {
        rig.push({0.0, std::numeric_limits<double>::quiet_NaN(), 0.0});
        rig.step();
        ASSERT_EQ(rig.tick.last().rendered.force, Vec3(0.0));
    }
    EXPECT_EQ(rig.tick.last().overlay_read, kOverlayRefused);
    EXPECT_EQ(rig.tick.instruments().overlays_refused, 200u);
    EXPECT_EQ(rig.tick.safety_state(), SafetyState::Running);
}

TEST(OverlayInTheTick, StaysWithTheContactWithinTheLimitsOfTheWrench) {
    TickSettings settings = with_overlay(5.0, 0.1);
    settings.overlay.ramp_ns = 1'000'000;  // the bounds of the wrench alone
    settings.limits.force = 2.0;
    settings.limits.force_rate = 100.0;
    OverlayRig rig(settings, hand_that_presses_twice());
    rig.run_up();
    Vec3 before = rig.tick.last().rendered.force;
    bool limited = false;
    for (int i = 0; i < 3000; ++i) {
        rig.publish(floor_frame(0.0, kFloorStiffness, rig.now_ns));
        const double angle = 2.399963 * i;
        rig.push(1e3 * Vec3(std::cos(angle), std::sin(angle), std::sin(0.1 * i)));
        rig.step();
        const TickRecord& record = rig.tick.last();
        ASSERT_LE(glm::length(record.rendered.force), 2.0 + 1e-9);
        ASSERT_LE(glm::length(record.rendered.force - before), 0.1 + 1e-9);
        before = record.rendered.force;
        limited = limited || (record.flags & HAPTIC_TICK_FORCE_LIMITED) != 0;
    }
    EXPECT_TRUE(limited);
    EXPECT_EQ(rig.tick.faults(), 0u);
}

TEST(OverlayInTheTick, LeavesImpulseAndEnergyOfTheContactAsTheyAre) {
    // The hand follows its recording whatever it feels, so that both runs have the same contact.
    OverlayRig with(with_overlay(), hand_that_presses_twice());
    OverlayRig without(with_overlay(), hand_that_presses_twice());
    double energy_error = 0.0;
    double impulse_error = 0.0;
    double pushed = 0.0;
    double bounced = 0.0;
    for (OverlayRig* const rig : {&with, &without}) {
        rig->run_up();
    }
    for (int i = 0; i < 3500; ++i) {
        if (i == 2600) {
            with.tick.stop();  // the parts of a fading wrench, too
            without.tick.stop();
        }
        with.push({0.6 * std::sin(0.01 * i), 0.8, 0.1}, {0.01, 0.0, 0.0});
        for (OverlayRig* const rig : {&with, &without}) {
            rig->publish(floor_frame(0.0, kFloorStiffness, rig->now_ns));
            rig->step();
        }
        const DeviceState one = with.state();
        const DeviceState other = without.state();
        ASSERT_EQ(with.tick.last().passivity_scale, without.tick.last().passivity_scale) << i;
        ASSERT_EQ(one.scale, other.scale) << "what the simulation's bodies get";
        impulse_error = std::max(impulse_error, glm::length(to_vec3(one.impulse) - to_vec3(other.impulse)));
        energy_error = std::max(energy_error, std::abs(with.tick.last().energy - without.tick.last().energy));
        bounced = other.impulse[1];
        pushed += 1e-3 * glm::length(with.tick.last().rendered.force - without.tick.last().rendered.force);
    }
    EXPECT_EQ(with.tick.safety_state(), SafetyState::Disarmed);
    EXPECT_GT(pushed, 2.0) << "N s; otherwise this proves nothing";
    EXPECT_GT(bounced, 1.0);
    // The overlay does work of some mJ. The rounding to DAC codes, 6.6 mN each, is another one in each run.
    EXPECT_LT(energy_error, 5e-5);
    EXPECT_LT(impulse_error, 1e-4);
}

TEST(OverlayInTheTick, GivesTheBodiesNothingAndTheObserverNoDebt) {
    // Along the overlay, so that it does work on the hand.
    const PoseTrack hand = {{0.0, 1.2, 2.2}, {Pose{}, Pose{}, Pose{{0.02, 0.0, 0.0}, kUpright}}};
    OverlayRig rig(with_overlay(), hand);
    rig.run_up();
    double work = 0.0;
    Wrench held;
    Vec3 before = rig.tick.last().pose.position;
    for (int i = 0; i < 2000; ++i) {
        rig.push({1.0, 0.0, 0.0});
        rig.step();
        const TickRecord& record = rig.tick.last();
        work += glm::dot(held.force, record.pose.position - before);
        held = record.made;
        before = record.pose.position;
        ASSERT_EQ(record.energy, 0.0);
        ASSERT_EQ(record.passivity_scale, 1.0);
    }
    EXPECT_NEAR(work, 0.02, 2e-3);
    EXPECT_NEAR(rig.tick.budget().given(), work, 5e-4) << "the budget counts it";
    const DeviceState state = rig.state();
    EXPECT_EQ(to_vec3(state.impulse), Vec3(0.0));
    EXPECT_EQ(to_vec3(state.angular_impulse), Vec3(0.0));
    EXPECT_NEAR(state.force[0], 1.0, kCodes) << "the hand feels it";
}

TEST(OverlayInTheTick, EndsASessionThatHasGivenItsEnergy) {
    TickSettings settings = with_overlay();
    settings.budget.session = 0.01;
    const PoseTrack hand = {{0.0, 1.2, 2.2}, {Pose{}, Pose{}, Pose{{0.02, 0.0, 0.0}, kUpright}}};
    OverlayRig rig(settings, hand);
    rig.run_up();
    for (int i = 0; i < 2000 && rig.tick.faults() == 0; ++i) {
        rig.push({1.0, 0.0, 0.0});
        rig.step();
    }
    EXPECT_EQ(rig.tick.faults(), static_cast<std::uint32_t>(HAPTIC_FAULT_BUDGET));
    EXPECT_NEAR(rig.tick.last().pose.position.x, 0.01, 2e-3);
}

TEST(OverlayInTheTick, RisesFromZeroAfterEachArming) {
    OverlayRig rig(with_overlay());
    const auto push_for = [&rig](int ticks) {
        for (int i = 0; i < ticks; ++i) {
            rig.push({1.0, 0.0, 0.0});
            rig.step();
        }
    };
    rig.run_up();
    push_for(200);
    rig.tick.stop();
    push_for(1000);
    ASSERT_EQ(rig.tick.safety_state(), SafetyState::Disarmed);
    rig.tick.arm();
    while (rig.tick.safety_state() != SafetyState::Running) {
        push_for(1);
    }
    for (int i = 1; i < 100; ++i) {
        ASSERT_LE(rig.tick.last().rendered.force.x, 0.01 * i + 1e-9);
        push_for(1);
    }
    push_for(10);
    EXPECT_NEAR(rig.tick.last().rendered.force.x, 1.0, 1e-12);
}

TEST(OverlayInTheTick, PressesACompliantHandOnAFloorWithoutVibration) {
    const PoseTrack hand = {{0.0, 1.5, 2.0}, {Pose{}, Pose{}, Pose{{0.0, -0.004, 0.0}, kUpright}}};
    TickSettings settings = with_overlay();
    settings.frames.max_stiffness = 600.0;
    OverlayRig rig(settings, hand, device::GripMechanics{});
    rig.run_up();
    ASSERT_EQ(rig.tick.safety_state(), SafetyState::Running);
    double fastest = 0.0;
    while (rig.now_ns < 6'000'000'000) {
        rig.publish(floor_frame(0.0, 600.0, rig.now_ns));
        rig.push({0.0, -1.0, 0.0});
        rig.step();
        if (rig.now_ns > 5'000'000'000) {
            fastest = std::max(fastest, glm::length(rig.board.device().grip_velocity().linear));
        }
    }
    EXPECT_LT(fastest, 2e-3) << "m/s";
    EXPECT_EQ(rig.tick.faults(), 0u);
}

/// Holds still for 15 s, the time for the proof of the wiring, then moves and turns about every axis.
PoseTrack hand_that_tries_the_device_out() {
    std::vector<double> times = {0.0};
    std::vector<Pose> poses = {Pose{}};
    for (int k = 0; k <= 2000; ++k) {
        const double t = 0.01 * k;
        const Vec3 turn = 0.16 * Vec3(std::sin(1.3 * t), std::sin(2.2 * t), std::sin(2.9 * t));
        const double angle = glm::length(turn);
        times.push_back(15.0 + t);
        poses.push_back({0.015 * Vec3(std::sin(1.1 * t), std::sin(1.9 * t), std::sin(2.6 * t)),
                         angle > 0.0 ? glm::angleAxis(angle, turn / angle) : kUpright});
    }
    return {std::move(times), std::move(poses)};
}

TEST(OverlayInTheTick, DoesNotPushUntilThePoseIsProved) {
    TickSettings settings = with_overlay();
    settings.safety.prove = true;
    OverlayRig rig(settings, hand_that_tries_the_device_out(), device::GripMechanics{});
    rig.tick.arm();
    int unproven = 0;
    bool pushed = false;
    while (rig.now_ns < 34'000'000'000 && !pushed) {
        rig.push({0.0, 1.0, 0.0}, {0.01, 0.0, 0.0});
        rig.step();
        const TickRecord& record = rig.tick.last();
        ASSERT_EQ(rig.tick.faults(), 0u) << rig.now_ns;
        pushed = (record.flags & HAPTIC_TICK_OVERLAY) != 0;
        if ((record.flags & HAPTIC_TICK_UNPROVEN) != 0) {
            ++unproven;
            ASSERT_FALSE(pushed && rig.tick.proof().pose != Proof::Passed);
            ASSERT_EQ(record.rendered.force, Vec3(0.0));
            ASSERT_EQ(record.rendered.torque, Vec3(0.0));
        }
    }
    EXPECT_GT(unproven, 1000) << "the rise alone takes a second";
    EXPECT_EQ(rig.tick.proof().pose, Proof::Passed);
    EXPECT_TRUE(pushed) << "from then on it pushes";
}

TickSettings with_overlay_and_walls(double max_force) {
    TickSettings settings = with_overlay(max_force);
    settings.frames.max_stiffness = 600.0;
    settings.frames.max_rotational_stiffness = 0.12;
    apply_profile(Config{}, normal_profile(), settings);
    settings.budget = {};
    return settings;
}

TEST(OverlayInTheTick, DoesNotLeadTheGripThroughTheWalls) {
    // A hand just inside the edge that lets itself be led: 5 N would move the firm one by 17 mm, and the walls give 1
    // N.
    const PoseTrack hand = {{0.0, 2.0, 2.5}, {Pose{}, Pose{}, Pose{{0.009, 0.0, 0.0}, kUpright}}};
    for (const double hand_stiffness : {300.0, 60.0}) {
        for (const double force : {1.0, 5.0}) {
            const TickSettings settings = with_overlay_and_walls(force);
            ASSERT_TRUE(settings.walls.on);
            device::GripMechanics mechanics;
            mechanics.hand_stiffness = hand_stiffness;
            mechanics.hand_damping = 0.2 * std::sqrt(hand_stiffness);
            OverlayRig rig(settings, hand, mechanics);
            rig.run_up();
            double farthest = 0.0;
            double fastest = 0.0;
            while (rig.now_ns < 6'000'000'000) {
                rig.push({force, 0.0, 0.0});
                rig.step();
                if (rig.now_ns > 5'000'000'000) {
                    farthest = std::max(farthest, rig.tick.last().pose.position.x);
                    fastest = std::max(fastest, glm::length(rig.board.device().grip_velocity().linear));
                }
            }
            EXPECT_NE(rig.tick.last().flags & HAPTIC_TICK_WORKSPACE_EDGE, 0u);
            EXPECT_NE(rig.tick.last().flags & HAPTIC_TICK_OVERLAY, 0u);
            EXPECT_LT(farthest, settings.walls.semi_axes.x + settings.walls.thickness)
                << force << " N, " << hand_stiffness;
            EXPECT_LT(fastest, 2e-3) << "m/s, vibration at the edge: " << force << " N, " << hand_stiffness;
            EXPECT_EQ(rig.tick.faults(), 0u);
        }
    }
}

}  // namespace
}  // namespace haptic::rt
