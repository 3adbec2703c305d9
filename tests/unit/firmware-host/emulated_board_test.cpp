#include "haptic/device/emulated_board.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <stdexcept>

namespace haptic::device {
namespace {

constexpr std::array<std::uint16_t, kStrings> kPowerUp = {0, 65535, 32768, 12345, 1, 40000, 7, 60000};

EmulatedBoard::Settings settings(const Pose& pose) {
    return {spidar_g6_x3r(), PoseTrack(pose), kPowerUp, 0};
}

Sh4Packet command_packet(const std::array<std::uint16_t, kStrings>& digits) {
    Sh4Packet out;
    encode(Sh4Command{digits}, out);
    return out;
}

Sh4Reply exchange(EmulatedBoard& board, const std::array<std::uint16_t, kStrings>& digits, std::int64_t now_ns = 0) {
    Sh4Packet in;
    EXPECT_EQ(board.exchange(command_packet(digits), in, now_ns), ExchangeStatus::Ok);
    Sh4Reply reply;
    EXPECT_EQ(decode(std::span<const std::byte>(in), reply), PacketDefect::None);
    return reply;
}

/// Rotation about an axis by Rodrigues' formula, so that the oracle shares no rotation code with the board.
Vec3 rotated(const Vec3& v, const Vec3& axis, double angle) {
    return v * std::cos(angle) + glm::cross(axis, v) * std::sin(angle) +
           axis * glm::dot(axis, v) * (1.0 - std::cos(angle));
}

TEST(EmulatedBoard, CountersAreThePowerUpValuesAtTheCentre) {
    EmulatedBoard board(settings({}));
    EXPECT_EQ(exchange(board, {}).counters, kPowerUp);
}

TEST(EmulatedBoard, CountersFollowTheLengthsRoundedAndWrapped) {
    const Variant variant = spidar_g6_x3r();
    std::mt19937 random(11);
    std::uniform_real_distribution<double> coordinate(-0.03, 0.03);
    std::uniform_real_distribution<double> angle(-0.6, 0.6);
    for (int k = 0; k < 500; ++k) {
        const Vec3 position(coordinate(random), coordinate(random), coordinate(random));
        const Vec3 axis = glm::normalize(Vec3(coordinate(random), coordinate(random), coordinate(random) + 0.05));
        const double turn = angle(random);
        const Vec3 imaginary = axis * std::sin(turn / 2.0);
        EmulatedBoard board(settings({position, Quat(std::cos(turn / 2.0), imaginary.x, imaginary.y, imaginary.z)}));
        const Sh4Reply reply = exchange(board, {});
        for (std::size_t i = 0; i < kStrings; ++i) {
            const StringFacts& string = variant.strings[i];
            const double length = glm::length(string.motor - position - rotated(string.grip, axis, turn));
            const double rest = glm::length(string.motor - string.grip);
            const double counts = -string.count_sign * (length - rest) / 1.66555e-5;
            // As an integer of any size, brought into 0..65535 by its remainder.
            const long raw = kPowerUp[i] + std::lround(counts);
            const long wrapped = ((raw % 65536) + 65536) % 65536;
            const long distance = std::labs(wrapped - reply.counters[i]);
            const bool at_a_half = std::abs(std::abs(counts - std::trunc(counts)) - 0.5) < 1e-6;
            EXPECT_LE(distance, at_a_half ? 1 : 0) << "string " << i << ", " << counts << " counts";
        }
    }
}

TEST(EmulatedBoard, RawCountersFallWherePositiveStringsPayOut) {
    // Away from motor 0 (sign +) and motor 4 (sign -), which stand at the left: both strings get longer.
    EmulatedBoard board(settings({{0.02, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}}));
    const Sh4Reply reply = exchange(board, {});
    EXPECT_LT(static_cast<std::int16_t>(reply.counters[0] - kPowerUp[0]), -500);
    EXPECT_GT(static_cast<std::int16_t>(reply.counters[4] - kPowerUp[4]), 500);
}

TEST(EmulatedBoard, CountersWrapManyTimesForAHandFarAway) {
    // 10 m is 600,000 counts: nine times round.
    const Vec3 away(10.0, 0.0, 0.0);
    EmulatedBoard board(settings({away, {1.0, 0.0, 0.0, 0.0}}));
    const Sh4Reply reply = exchange(board, {});
    const StringFacts string = spidar_g6_x3r().strings[0];
    const double counts =
        (glm::length(string.motor - away - string.grip) - glm::length(string.motor - string.grip)) / 1.66555e-5;
    ASSERT_GT(counts, 9 * 65536);
    EXPECT_EQ(reply.counters[0], (((kPowerUp[0] - std::lround(counts)) % 65536) + 65536) % 65536);
}

TEST(EmulatedBoard, EchoesTheDigitsOfTheSamePacket) {
    EmulatedBoard board(settings({}));
    const std::array<std::uint16_t, kStrings> first = {45, 46, 47, 48, 49, 50, 51, 52};
    const std::array<std::uint16_t, kStrings> second = {4095, 0, 1, 2, 3, 4, 5, 6};
    EXPECT_EQ(exchange(board, first).digits, first);
    EXPECT_EQ(exchange(board, second).digits, second);
}

TEST(EmulatedBoard, ReportsButtonsAndRotarySwitch) {
    EmulatedBoard::Settings with_rotary = settings({});
    with_rotary.rotary = 0xA;
    EmulatedBoard board(std::move(with_rotary));
    EXPECT_EQ(exchange(board, {}).pio, 0x00A0);
    board.set_buttons(0x5);
    EXPECT_EQ(exchange(board, {}).pio, 0x00A5);
    board.set_buttons(0xFF);  // three switches exist
    EXPECT_EQ(exchange(board, {}).pio, 0x00A7);
}

TEST(EmulatedBoard, PullsWithTheTensionsOfItsDigits) {
    EmulatedBoard board(settings({}));
    EXPECT_EQ(board.tensions(), (std::array<double, kStrings>{}));
    exchange(board, {45, 3031, 4095, 1, 0, 100, 200, 300});
    const std::array<double, kStrings> tensions = board.tensions();
    const double newtons_per_digit = 1.0 / (0.365296803653 * 415.0);
    EXPECT_DOUBLE_EQ(tensions[0], 45 * newtons_per_digit);
    EXPECT_DOUBLE_EQ(tensions[1], 3031 * newtons_per_digit);
    EXPECT_DOUBLE_EQ(tensions[2], 4095 * newtons_per_digit);
    EXPECT_DOUBLE_EQ(tensions[4], 0.0);
}

TEST(EmulatedBoard, WrenchIsTheGradientOfTheWorkOfTheStrings) {
    // Virtual work: with constant tensions the strings do -sum t_i dl_i, so force and torque are its derivatives by
    // position and rotation. Lengths by finite differences, without any cross product.
    const Variant variant = spidar_g6_x3r();
    const Vec3 position(0.011, -0.017, 0.006);
    const Vec3 axis = glm::normalize(Vec3(0.3, -0.5, 0.8));
    const double turn = 0.4;
    const Vec3 imaginary = axis * std::sin(turn / 2.0);
    EmulatedBoard board(settings({position, Quat(std::cos(turn / 2.0), imaginary.x, imaginary.y, imaginary.z)}));
    exchange(board, {100, 900, 45, 300, 1500, 600, 45, 2000});
    const std::array<double, kStrings> tensions = board.tensions();
    const Wrench wrench = board.wrench();

    const auto work = [&](const Vec3& shift, const Vec3& about, double by) {
        double sum = 0.0;
        for (std::size_t i = 0; i < kStrings; ++i) {
            const Vec3 arm = rotated(rotated(variant.strings[i].grip, axis, turn), about, by);
            sum -= tensions[i] * glm::length(variant.strings[i].motor - (position + shift) - arm);
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

TEST(EmulatedBoard, HandFollowsItsTrackFromTheFirstExchange) {
    const Quat level(1.0, 0.0, 0.0, 0.0);
    EmulatedBoard::Settings moving = settings({});
    moving.hand = PoseTrack({0.0, 1.0}, {{{0.0, 0.0, 0.0}, level}, {{0.02, 0.0, 0.0}, level}});
    EmulatedBoard board(std::move(moving));
    constexpr std::int64_t kStart = 987'654'321'000;
    EXPECT_EQ(exchange(board, {}, kStart).counters, kPowerUp);
    EXPECT_EQ(board.grip_pose().position.x, 0.0);
    exchange(board, {}, kStart + 500'000'000);
    EXPECT_NEAR(board.grip_pose().position.x, 0.01, 1e-12);
    exchange(board, {}, kStart + 5'000'000'000);
    EXPECT_NEAR(board.grip_pose().position.x, 0.02, 1e-12);
}

TEST(EmulatedBoard, AnswersNothingToAnotherOpcodeAndKeepsItsMotors) {
    EmulatedBoard board(settings({}));
    const std::array<std::uint16_t, kStrings> digits = {45, 45, 45, 45, 45, 45, 45, 45};
    exchange(board, digits);
    const std::array<double, kStrings> before = board.tensions();

    Sh4Packet wrong = command_packet({});
    wrong[1] = std::byte{0x0D};
    Sh4Packet in;
    in.fill(std::byte{0x77});
    const Sh4Packet untouched = in;
    EXPECT_EQ(board.exchange(wrong, in, 0), ExchangeStatus::Timeout);
    EXPECT_EQ(in, untouched);

    Sh4Packet beyond = command_packet({});
    beyond[3] = std::byte{0x10};
    EXPECT_EQ(board.exchange(beyond, in, 0), ExchangeStatus::Refused);
    EXPECT_EQ(in, untouched);
    EXPECT_EQ(board.tensions(), before);
}

TEST(EmulatedBoard, RefusesSettingsThatItCannotEmulate) {
    EmulatedBoard::Settings wrong = settings({});
    wrong.rotary = 16;
    EXPECT_THROW(EmulatedBoard{wrong}, std::invalid_argument);
    wrong = settings({});
    wrong.variant.metres_per_count = 0.0;
    EXPECT_THROW(EmulatedBoard{wrong}, std::invalid_argument);
    wrong = settings({});
    wrong.variant.volts_per_newton = std::numeric_limits<double>::quiet_NaN();
    EXPECT_THROW(EmulatedBoard{wrong}, std::invalid_argument);
}

}  // namespace
}  // namespace haptic::device
