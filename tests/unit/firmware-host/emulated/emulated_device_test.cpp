#include "haptic/device/emulated_device.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>
#include <utility>

#include "sample_device.hpp"

namespace haptic::device {
namespace {

using test::kMs;
using test::kPowerUp;
using test::kPulse;

EmulatedDevice::Settings settings_at(const Pose& pose) {
    return {.geometry = spidar_g6_x3r(), .hand = PoseTrack(pose), .power_up = kPowerUp};
}

/// Rotation by Rodrigues' formula, an oracle that shares no code with the device.
Vec3 rotated(const Vec3& v, const Vec3& axis, double angle) {
    return v * std::cos(angle) + glm::cross(axis, v) * std::sin(angle) +
           axis * glm::dot(axis, v) * (1.0 - std::cos(angle));
}

TEST(EmulatedDevice, CountersAreThePowerUpValuesAtTheCentre) {
    EmulatedDevice device(settings_at({}));
    EXPECT_EQ(device.counters(), kPowerUp);
}

TEST(EmulatedDevice, CountersFollowTheLengthsRoundedAndWrapped) {
    const DeviceGeometry geometry = spidar_g6_x3r();
    std::mt19937 random(11);
    std::uniform_real_distribution<double> coordinate(-0.03, 0.03);
    std::uniform_real_distribution<double> angle(-0.6, 0.6);
    for (int k = 0; k < 500; ++k) {
        const Vec3 position(coordinate(random), coordinate(random), coordinate(random));
        const Vec3 axis = glm::normalize(Vec3{coordinate(random), coordinate(random), coordinate(random) + 0.05});
        const double turn = angle(random);
        const Vec3 imaginary = axis * std::sin(turn / 2.0);
        EmulatedDevice device(
            settings_at({position, Quat(std::cos(turn / 2.0), imaginary.x, imaginary.y, imaginary.z)}));
        const auto counters = device.counters();
        for (std::size_t i = 0; i < kStrings; ++i) {
            const StringFacts& string = geometry.strings[i];
            const double length = glm::length(string.motor - position - rotated(string.grip, axis, turn));
            const double rest = glm::length(string.motor - string.grip);
            const double counted = (length - rest) / string.metres_per_count;
            // Reduced modulo 65536 as an integer.
            const long raw = static_cast<long>(kPowerUp[i]) + std::lround(counted);
            const long wrapped = ((raw % 65536) + 65536) % 65536;
            const long distance = std::labs(wrapped - static_cast<long>(counters[i]));
            const bool at_a_half = std::abs(std::abs(counted - std::trunc(counted)) - 0.5) < 1e-6;
            EXPECT_LE(distance, at_a_half ? 1 : 0) << "string " << i << ", " << counted << " counts";
        }
    }
}

TEST(EmulatedDevice, CountersRiseWherePositiveStringsPayOut) {
    // Away from motor 0 (sign +) and motor 4 (sign -), which are on the left: both strings lengthen.
    EmulatedDevice device(settings_at({{0.02, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}}));
    const auto counters = device.counters();
    EXPECT_GT(static_cast<std::int16_t>(counters[0] - kPowerUp[0]), 500);
    EXPECT_LT(static_cast<std::int16_t>(counters[4] - kPowerUp[4]), -500);
}

TEST(EmulatedDevice, CountersWrapManyTimesForAHandFarAway) {
    // 10 m is 600,000 counts: nine wraps.
    const Vec3 away(10.0, 0.0, 0.0);
    EmulatedDevice device(settings_at({away, {1.0, 0.0, 0.0, 0.0}}));
    const auto counters = device.counters();
    const StringFacts string = spidar_g6_x3r().strings[0];
    const double counted =
        (glm::length(string.motor - away - string.grip) - glm::length(string.motor - string.grip)) / kPulse;
    ASSERT_GT(counted, 9 * 65536);
    EXPECT_EQ(counters[0], (kPowerUp[0] + std::lround(counted)) % 65536);
}

TEST(EmulatedDevice, PullsWithTheTensionsOfItsDacCodes) {
    EmulatedDevice device(settings_at({}));
    EXPECT_EQ(device.tensions(), (std::array<double, kStrings>{}));
    device.set_dac_codes({45, 3031, 4095, 1, 0, 100, 200, 300});
    const std::array<double, kStrings> tensions = device.tensions();
    const double newtons_per_code = 1.0 / (0.365296803653 * 415.0);
    EXPECT_DOUBLE_EQ(tensions[0], 45 * newtons_per_code);
    EXPECT_DOUBLE_EQ(tensions[1], 3031 * newtons_per_code);
    EXPECT_DOUBLE_EQ(tensions[2], 4095 * newtons_per_code);
    EXPECT_DOUBLE_EQ(tensions[4], 0.0);
}

TEST(EmulatedDevice, WrenchIsTheGradientOfTheWorkOfTheStrings) {
    // Virtual work: with constant tensions the strings do the work -sum t_i dl_i, so force and torque are its
    // derivatives with respect to position and rotation. Finite differences of lengths, without cross products.
    const DeviceGeometry geometry = spidar_g6_x3r();
    const Vec3 position(0.011, -0.017, 0.006);
    const Vec3 axis = glm::normalize(Vec3(0.3, -0.5, 0.8));
    const double turn = 0.4;
    const Vec3 imaginary = axis * std::sin(turn / 2.0);
    EmulatedDevice device(settings_at({position, Quat(std::cos(turn / 2.0), imaginary.x, imaginary.y, imaginary.z)}));
    device.set_dac_codes({100, 900, 45, 300, 1500, 600, 45, 2000});
    const std::array<double, kStrings> tensions = device.tensions();
    const Wrench wrench = device.wrench();

    const auto work = [&](const Vec3& shift, const Vec3& about, double by) {
        double sum = 0.0;
        for (std::size_t i = 0; i < kStrings; ++i) {
            const Vec3 arm = rotated(rotated(geometry.strings[i].grip, axis, turn), about, by);
            sum -= tensions[i] * glm::length(geometry.strings[i].motor - (position + shift) - arm);
        }
        return sum;
    };
    constexpr double kStep = 1e-6;  // m, rad: truncation 1e-10, rounding 1e-9 of some 10 N
    for (int k = 0; k < 3; ++k) {
        Vec3 unit(0.0, 0.0, 0.0);
        unit[k] = 1.0;
        const double force = (work(unit * kStep, unit, 0.0) - work(-unit * kStep, unit, 0.0)) / (2.0 * kStep);
        const double torque = (work({}, unit, kStep) - work({}, unit, -kStep)) / (2.0 * kStep);
        EXPECT_NEAR(wrench.force[k], force, 1e-7);
        EXPECT_NEAR(wrench.torque[k], torque, 1e-7);
    }
}

TEST(EmulatedDevice, HandFollowsItsTrackFromTheFirstAdvance) {
    const Quat level(1.0, 0.0, 0.0, 0.0);
    EmulatedDevice::Settings moving = settings_at({});
    moving.hand = PoseTrack({0.0, 1.0}, {{{0.0, 0.0, 0.0}, level}, {{0.02, 0.0, 0.0}, level}});
    EmulatedDevice device(std::move(moving));
    constexpr std::int64_t kStart = 987'654'321'000;
    device.advance(kStart);
    EXPECT_EQ(device.counters(), kPowerUp);
    EXPECT_EQ(device.grip_pose().position.x, 0.0);
    device.advance(kStart + 500'000'000);
    EXPECT_NEAR(device.grip_pose().position.x, 0.01, 1e-12);
    device.advance(kStart + 5'000'000'000);
    EXPECT_NEAR(device.grip_pose().position.x, 0.02, 1e-12);
}

TEST(EmulatedDevice, HandWaitsAtTheBeginningOfItsTrackUntilItIsReleased) {
    const Quat level(1.0, 0.0, 0.0, 0.0);
    EmulatedDevice::Settings waiting = settings_at({});
    waiting.hand = PoseTrack({0.0, 1.0}, {{{0.0, 0.0, 0.0}, level}, {{0.02, 0.0, 0.0}, level}});
    waiting.hand_waits = true;
    EmulatedDevice device(std::move(waiting));
    for (const std::int64_t now_ns : {5, 2'000'000'000}) {
        device.advance(now_ns);
        EXPECT_EQ(device.grip_pose().position.x, 0.0);
    }
    device.release_hand();
    device.advance(2'250'000'000);
    EXPECT_NEAR(device.grip_pose().position.x, 0.005, 1e-12);
}

TEST(EmulatedDevice, CountersOfTheSimpleBoardHave24Bits) {
    EmulatedDevice::Settings wide = settings_at({{0.0, 0.02, 0.0}, Quat(1.0, 0.0, 0.0, 0.0)});
    wide.geometry.board = BoardKind::Simple;
    wide.power_up.fill(0);
    const auto counters = EmulatedDevice(wide).counters();
    EXPECT_GT(counters[0], 0U);  // longer, sign +
    EXPECT_LT(counters[0], 2000U);
    EXPECT_GT(counters[2], 0xFFFFFFU - 2000U);  // longer, sign -
    EXPECT_LE(counters[2], 0xFFFFFFU);
}

EmulatedDevice::Settings with_mechanics(const GripMechanics& mechanics = {}) {
    EmulatedDevice::Settings moving = settings_at({});
    moving.mechanics = mechanics;
    return moving;
}

TEST(EmulatedDevice, HandWithImpedanceGivesWayToTheStrings) {
    EmulatedDevice device(with_mechanics());
    device.advance(0);
    // Strings 2, 6 (right) and 0, 4 (left): more pull from the right.
    device.set_dac_codes({45, 45, 445, 45, 45, 45, 445, 45});
    for (int k = 1; k <= 3000; ++k) {
        device.advance(k * kMs);
    }
    // The hand's spring: force / 400 N/m, except for friction of 20 mN in each motor.
    const Wrench wrench = device.wrench();
    EXPECT_GT(wrench.force.x, 2.0);
    EXPECT_NEAR(device.grip_pose().position.x, wrench.force.x / 400.0, 1e-5);
    EXPECT_LT(glm::length(device.grip_velocity().linear), 1e-5);
    for (std::size_t i = 0; i < kStrings; ++i) {
        EXPECT_NEAR(device.string_tensions()[i], device.tensions()[i], 0.021);
    }
}

TEST(EmulatedDevice, EncodersCountWhatTheMotorsPaidOutAndNotWhereTheGripIs) {
    // No motor pulls: the hand moves the grip to the left, strings 0 and 4 become slack, and their motors do not turn.
    EmulatedDevice::Settings moving = with_mechanics();
    moving.hand = PoseTrack(
        {0.0, 0.2}, {{{0.0, 0.0, 0.0}, Quat(1.0, 0.0, 0.0, 0.0)}, {{-0.02, 0.0, 0.0}, Quat(1.0, 0.0, 0.0, 0.0)}});
    EmulatedDevice device(std::move(moving));
    for (int k = 0; k <= 400; ++k) {
        device.advance(k * kMs);
    }
    EXPECT_NEAR(device.grip_pose().position.x, -0.02, 2e-3);
    EXPECT_EQ(device.counters()[0], kPowerUp[0]);
    EXPECT_EQ(device.counters()[4], kPowerUp[4]);
    EXPECT_EQ(device.string_tensions()[0], 0.0);
    const auto paid_out = static_cast<std::int16_t>(kPowerUp[2] - device.counters()[2]);  // sign -
    EXPECT_NEAR(paid_out * kPulse, 0.018, 2e-3);
}

TEST(EmulatedDevice, MotorsKeepTheirDacCodesUntilNewOnesArrive) {
    EmulatedDevice device(with_mechanics({.hand = Hand::Free}));
    device.advance(0);
    device.set_dac_codes({0, 0, 1000, 0, 0, 0, 1000, 0});
    device.advance(20 * kMs);
    const Vec3 early = device.grip_velocity().linear;
    device.advance(40 * kMs);
    EXPECT_GT(early.x, 0.1);
    EXPECT_GT(device.grip_velocity().linear.x, early.x);
}

TEST(EmulatedDevice, WaitingHandHoldsAFreeGripUntilItIsReleased) {
    EmulatedDevice::Settings free = with_mechanics({.hand = Hand::Free});
    free.hand_waits = true;
    EmulatedDevice device(std::move(free));
    device.advance(0);
    device.set_dac_codes({45, 45, 445, 45, 45, 45, 445, 45});
    device.advance(40 * kMs);
    EXPECT_EQ(device.grip_pose().position, Vec3(0.0, 0.0, 0.0));
    device.release_hand();
    device.advance(60 * kMs);
    EXPECT_GT(device.grip_pose().position.x, 1e-4);
}

TEST(EmulatedDevice, RefusesSettingsThatItCannotEmulate) {
    EmulatedDevice::Settings wrong = settings_at({});
    wrong.rotary = 16;
    EXPECT_THROW(EmulatedDevice{wrong}, std::invalid_argument);
    wrong = settings_at({});
    wrong.mechanics = GripMechanics{.mass = -0.1};
    EXPECT_THROW(EmulatedDevice{wrong}, std::invalid_argument);
    wrong = settings_at({});
    wrong.geometry.strings[7].metres_per_count = 0.0;
    EXPECT_THROW(EmulatedDevice{wrong}, std::invalid_argument);
    wrong = settings_at({});
    wrong.geometry.strings[0].newtons_per_code = std::numeric_limits<double>::quiet_NaN();
    EXPECT_THROW(EmulatedDevice{wrong}, std::invalid_argument);
}

}  // namespace
}  // namespace haptic::device
