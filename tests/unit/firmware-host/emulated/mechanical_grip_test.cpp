#include "emulated/mechanical_grip.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <stdexcept>

#include "emulated/hand_motion.hpp"
#include "sample_device.hpp"

namespace haptic::device {
namespace {

using test::kLevel;
using test::kMs;

/// A hand that starts to swing at kStart.
class Swing {
  public:
    explicit Swing(const GripMechanics& mechanics = {})
        : track_({0.0, 0.1, 0.2, 0.3}, {{{0.0, 0.0, 0.0}, kLevel},
                                        {{0.02, 0.01, 0.0}, glm::normalize(Quat(1.0, 0.1, 0.0, 0.05))},
                                        {{-0.01, 0.015, 0.02}, glm::normalize(Quat(1.0, -0.1, 0.1, 0.0))},
                                        {{0.0, -0.02, 0.01}, kLevel}}),
          hand_(track_, false),
          grip_(spidar_g6_x3r(), mechanics, track_.at(0)) {
        drive_.pull = {1.0, 0.4, 2.0, 0.3, 0.7, 1.5, 0.3, 0.9};
    }
    void advance(std::int64_t now_ns) {
        hand_.advance(now_ns - last_ns_);
        last_ns_ = now_ns;
        grip_.advance(now_ns, drive_, hand_);
    }

    static constexpr std::int64_t kStart = 123'456'789'012;
    PoseTrack track_;
    HandMotion hand_;
    MechanicalGrip grip_;
    MechanicalGrip::Drive drive_;
    std::int64_t last_ns_ = kStart;
};

TEST(MechanicalGrip, TheSameTimeInOtherPortionsGivesTheSameBits) {
    std::mt19937_64 random(3);
    constexpr std::int64_t kEnd = Swing::kStart + 300 * kMs + 12'345;  // between two steps
    Swing even;
    for (std::int64_t now_ns = Swing::kStart; now_ns < kEnd; now_ns += kMs) {
        even.advance(now_ns);
    }
    even.advance(kEnd);
    for (int k = 0; k < 5; ++k) {
        Swing odd;
        std::uniform_int_distribution<std::int64_t> portion(0, k < 4 ? 3 * kMs : 20'000);
        for (std::int64_t now_ns = Swing::kStart; now_ns < kEnd; now_ns += portion(random)) {
            odd.advance(now_ns);
        }
        odd.advance(kEnd);
        EXPECT_EQ(odd.grip_.state().pose.position, even.grip_.state().pose.position);
        EXPECT_EQ(odd.grip_.state().pose.orientation, even.grip_.state().pose.orientation);
        EXPECT_EQ(odd.grip_.state().length, even.grip_.state().length);
    }
}

TEST(MechanicalGrip, FollowsAFirmHandClosely) {
    GripMechanics firm;
    firm.hand_stiffness = 20'000.0;
    firm.hand_damping = 40.0;
    Swing swing(firm);
    for (std::int64_t t_ns = 0; t_ns <= 300 * kMs; t_ns += kMs) {
        swing.advance(Swing::kStart + t_ns);
        // 3 N of the strings, and velocity jumps of 0.5 m/s of 0.1 kg at corners of the track, at 20,000 N/m.
        EXPECT_LT(glm::length(swing.grip_.state().pose.position - swing.track_.at(t_ns).position), 1.5e-3);
    }
}

TEST(MechanicalGrip, BetweenStepsTheGripGoesOnAtItsVelocity) {
    GripMechanics free;
    free.hand = Hand::Free;
    Swing swing(free);
    swing.advance(Swing::kStart);
    swing.advance(Swing::kStart + 10 * kMs);
    const GripState at_step = swing.grip_.state();
    swing.advance(Swing::kStart + 10 * kMs + 20'000);  // 20 of 50 us
    const Vec3 moved = swing.grip_.state().pose.position - at_step.pose.position;
    EXPECT_GT(glm::length(at_step.velocity), 0.01);
    EXPECT_NEAR(glm::length(moved - at_step.velocity * 20e-6), 0.0, 1e-15);
    EXPECT_NEAR(swing.grip_.state().length[0] - at_step.length[0], at_step.length_rate[0] * 20e-6, 1e-15);
}

TEST(MechanicalGrip, AfterALongGapTheHandHasCarriedTheGripAlong) {
    Swing swing;
    swing.advance(Swing::kStart);
    // Two hours at once, most of them at the end of the track.
    swing.advance(Swing::kStart + 7'200'000 * kMs);
    const GripState& state = swing.grip_.state();
    EXPECT_LT(glm::length(state.pose.position - swing.track_.at(300 * kMs).position), 0.015);
    EXPECT_LT(glm::length(state.velocity), 1.0);
    const DeviceGeometry geometry = spidar_g6_x3r();
    for (std::size_t i = 0; i < kStrings; ++i) {
        const double span = glm::length(geometry.strings[i].motor - state.pose.position -
                                        state.pose.orientation * geometry.strings[i].grip);
        EXPECT_NEAR(state.length[i], span, 0.003) << "string " << i;
    }
}

TEST(MechanicalGrip, TimeThatGoesBackwardsChangesNothing) {
    Swing swing;
    swing.advance(Swing::kStart);
    swing.advance(Swing::kStart + 50 * kMs);
    const GripState before = swing.grip_.state();
    swing.advance(Swing::kStart + 20 * kMs);
    EXPECT_EQ(swing.grip_.state().pose.position, before.pose.position);
    EXPECT_EQ(swing.grip_.state().length, before.length);
}

TEST(MechanicalGrip, HeldGripStaysWhereItIsWhileMotorsPull) {
    GripMechanics free;
    free.hand = Hand::Free;
    Swing swing(free);
    swing.drive_.held = true;
    for (std::int64_t t_ns = 0; t_ns <= 100 * kMs; t_ns += kMs) {
        swing.advance(Swing::kStart + t_ns);
    }
    EXPECT_EQ(swing.grip_.state().pose.position, Vec3(0.0, 0.0, 0.0));
    swing.drive_.held = false;
    swing.advance(Swing::kStart + 120 * kMs);
    EXPECT_NE(swing.grip_.state().pose.position, Vec3(0.0, 0.0, 0.0));
}

TEST(MechanicalGrip, StepDividesAMillisecondAndShrinksForStiffStrings) {
    GripMechanics stiff;
    stiff.string_stiffness = 4e6;
    const MechanicalGrip usual(spidar_g6_x3r(), GripMechanics{}, {});
    const MechanicalGrip short_steps(spidar_g6_x3r(), stiff, {});
    EXPECT_EQ(usual.step_ns(), 50'000);
    EXPECT_LT(short_steps.step_ns(), 50'000);
    EXPECT_EQ(kMs % short_steps.step_ns(), 0);
    EXPECT_LE(static_cast<double>(short_steps.step_ns()) * 1e-9, longest_step_s(spidar_g6_x3r(), stiff));
    stiff.string_stiffness = 1e9;
    EXPECT_THROW(MechanicalGrip(spidar_g6_x3r(), stiff, {}), std::invalid_argument);
}

}  // namespace
}  // namespace haptic::device
