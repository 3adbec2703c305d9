#include "boards/simple_board.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "bytes.hpp"
#include "codecs/simple_codec.hpp"
#include "emulated/simple_firmware.hpp"
#include "haptic/device/emulated_board.hpp"
#include "haptic/device/emulated_device.hpp"
#include "rough_cable.hpp"
#include "sample_device.hpp"

namespace haptic::device {
namespace {

using test::bytes;
using test::counts_of_a_step_to_the_right;

constexpr std::array<std::uint32_t, kStrings> kSimplePowerUp = {0, 0xFFFFFF, 0x800000, 12345, 1, 40000, 7, 60000};
constexpr std::array<std::int16_t, kStrings> kSimpleDacCodes = {45, 46, 47, 48, 49, 50, 51, 4095};

EmulatedDevice::Settings simple_settings(PoseTrack hand = PoseTrack(Pose{})) {
    DeviceGeometry geometry = spidar_g6_x3r();
    geometry.board = BoardKind::Simple;
    return {.geometry = geometry, .hand = std::move(hand), .power_up = kSimplePowerUp, .rotary = 0xA};
}

/// A millisecond at the centre, then 20 mm to the right.
PoseTrack step_to_the_right() {
    const Quat level(1.0, 0.0, 0.0, 0.0);
    return {{0.0, 0.001}, {{{0.0, 0.0, 0.0}, level}, {{0.02, 0.0, 0.0}, level}}};
}

class SimpleBoardTest : public testing::Test {
  protected:
    EmulatedDevice device{simple_settings(step_to_the_right())};
    SimpleFirmware firmware{device};
    test::RoughCable cable{firmware};
    SimpleBoard board{cable};
    BoardReading reading;
};

TEST_F(SimpleBoardTest, StartsWithDirectionsThenClearedCounters) {
    board.start();
    ASSERT_EQ(cable.sent.size(), 2U);
    EXPECT_EQ(cable.sent[0], bytes({0xA2, 0x1A, 0xFF}, 32));
    EXPECT_EQ(cable.sent[1], bytes({0xA2, 0x19, 0xFF}, 32));
    ASSERT_EQ(board.exchange({kSimpleDacCodes}, reading, 0), ExchangeStatus::Ok);
    EXPECT_EQ(reading.counters, (std::array<std::uint32_t, kStrings>{}));
}

TEST_F(SimpleBoardTest, SendsDacCodesThenLatch) {
    board.start();
    cable.sent.clear();
    ASSERT_EQ(board.exchange({kSimpleDacCodes}, reading, 0), ExchangeStatus::Ok);
    ASSERT_EQ(cable.sent.size(), 2U);
    EXPECT_EQ(cable.sent[0], bytes({0x52, 45, 0, 46, 0, 47, 0, 48, 0, 49, 0, 50, 0, 51, 0, 0xFF, 0x0F}, 32));
    EXPECT_EQ(cable.sent[1], bytes({0x51}, 32));
    EXPECT_EQ(device.dac_codes(), kSimpleDacCodes);
}

TEST_F(SimpleBoardTest, CountsInTheHostsSenseModulo24Bits) {
    board.start();
    ASSERT_EQ(board.exchange({}, reading, 0), ExchangeStatus::Ok);
    ASSERT_EQ(board.exchange({}, reading, 2'000'000), ExchangeStatus::Ok);
    for (std::size_t i = 0; i < kStrings; ++i) {
        EXPECT_EQ(reading.counters[i], static_cast<std::uint32_t>(counts_of_a_step_to_the_right(i)) & 0xFFFFFFU) << i;
        EXPECT_GT(std::abs(counts_of_a_step_to_the_right(i)), 100) << i;
    }
}

TEST_F(SimpleBoardTest, CountsBackwardsInChannelsOfTheOtherPhase) {
    SimpleBoard mixed(cable, 0x0F);
    mixed.start();
    ASSERT_EQ(mixed.exchange({}, reading, 0), ExchangeStatus::Ok);
    ASSERT_EQ(mixed.exchange({}, reading, 2'000'000), ExchangeStatus::Ok);
    for (std::size_t i = 0; i < kStrings; ++i) {
        const long counts = i < 4 ? counts_of_a_step_to_the_right(i) : -counts_of_a_step_to_the_right(i);
        EXPECT_EQ(reading.counters[i], static_cast<std::uint32_t>(counts) & 0xFFFFFFU) << i;
    }
}

TEST_F(SimpleBoardTest, ABoardThatWasNotStartedCountsBackwardsFromAnywhere) {
    ASSERT_EQ(board.exchange({}, reading, 0), ExchangeStatus::Ok);
    EXPECT_EQ(reading.counters, kSimplePowerUp);
    ASSERT_EQ(board.exchange({}, reading, 2'000'000), ExchangeStatus::Ok);
    for (std::size_t i = 0; i < kStrings; ++i) {
        EXPECT_EQ(reading.counters[i],
                  (kSimplePowerUp[i] - static_cast<std::uint32_t>(counts_of_a_step_to_the_right(i))) & 0xFFFFFFU)
            << i;
    }
}

TEST_F(SimpleBoardTest, BringsButtonsAndRotary) {
    board.start();
    device.set_buttons(0x5);
    ASSERT_EQ(board.exchange({}, reading, 0), ExchangeStatus::Ok);
    EXPECT_EQ(reading.buttons, 0x5U);
    EXPECT_EQ(reading.rotary, 0xA);
}

TEST_F(SimpleBoardTest, ClampsDacCodesToTheRangeOfItsUnsignedDac) {
    board.start();
    ASSERT_EQ(board.exchange({{-5, -4095, 7, 4096, 32767, -32768, 0, 0}}, reading, 0), ExchangeStatus::Ok);
    EXPECT_EQ(device.dac_codes(), (std::array<std::int16_t, kStrings>{0, 0, 7, 4095, 4095, 0, 0, 0}));
}

TEST_F(SimpleBoardTest, ZeroesTheMotors) {
    board.start();
    ASSERT_EQ(board.exchange({kSimpleDacCodes}, reading, 0), ExchangeStatus::Ok);
    board.zero_motors(0);
    EXPECT_EQ(device.dac_codes(), (std::array<std::int16_t, kStrings>{}));
}

TEST_F(SimpleBoardTest, ThrowsAwayAnAnswerToAnEarlierSession) {
    firmware.receive(bytes({0x51}, 32), 0);
    board.start();
    ASSERT_EQ(board.exchange({}, reading, 0), ExchangeStatus::Ok);
    EXPECT_EQ(reading.counters, (std::array<std::uint32_t, kStrings>{})) << "cleared, so after the start";
}

TEST_F(SimpleBoardTest, TakesNoOldAnswerForANewOneAfterATimeOut) {
    board.start();
    ASSERT_EQ(board.exchange({}, reading, 0), ExchangeStatus::Ok);
    cable.answers_held_back = 1;
    EXPECT_EQ(board.exchange({}, reading, 500'000), ExchangeStatus::Timeout);
    ASSERT_EQ(board.exchange({}, reading, 2'000'000), ExchangeStatus::Ok);
    EXPECT_EQ(reading.counters[0], static_cast<std::uint32_t>(counts_of_a_step_to_the_right(0)));
}

TEST_F(SimpleBoardTest, SendsWithoutWaitingAndCollectsTheAnswerLater) {
    board.start();
    ASSERT_EQ(board.exchange({}, reading, 0), ExchangeStatus::Ok);
    ASSERT_EQ(board.send({kSimpleDacCodes}, 500'000), ExchangeStatus::Ok);
    EXPECT_EQ(device.dac_codes(), kSimpleDacCodes);
    EXPECT_TRUE(board.answer_due());
    EXPECT_EQ(board.collect(1'000'000), ExchangeStatus::Ok);
    EXPECT_FALSE(board.answer_due());
    EXPECT_EQ(board.collect(1'000'000), ExchangeStatus::Ok) << "nothing is due";
    // An exchange that follows a command whose answer was not collected takes its own answer.
    ASSERT_EQ(board.send({kSimpleDacCodes}, 500'000), ExchangeStatus::Ok);
    ASSERT_EQ(board.exchange({}, reading, 2'000'000), ExchangeStatus::Ok);
    EXPECT_EQ(reading.counters[0], static_cast<std::uint32_t>(counts_of_a_step_to_the_right(0)));
    // A late answer is a time-out, and not taken for the next one.
    cable.answers_held_back = 1;
    ASSERT_EQ(board.send({kSimpleDacCodes}, 0), ExchangeStatus::Ok);
    EXPECT_EQ(board.collect(0), ExchangeStatus::Timeout);
    ASSERT_EQ(board.exchange({}, reading, 2'000'000), ExchangeStatus::Ok);
    EXPECT_EQ(reading.counters[0], static_cast<std::uint32_t>(counts_of_a_step_to_the_right(0)));
}

TEST_F(SimpleBoardTest, LeavesTheReadingOnAnAnswerOfAnotherLength) {
    board.start();
    ASSERT_EQ(board.exchange({}, reading, 0), ExchangeStatus::Ok);
    const BoardReading before = reading;
    for (const std::size_t length : {1U, 31U, 25U}) {
        cable.change = [&](std::span<std::byte>) { return length; };
        EXPECT_EQ(board.exchange({}, reading, 2'000'000), ExchangeStatus::Short);
        EXPECT_EQ(reading, before);
    }
}

TEST_F(SimpleBoardTest, SaysWhatIsWrongWhereTheBoardDoesNotTakeItsStartUpPackets) {
    cable.next_status = ExchangeStatus::Stalled;
    try {
        board.start();
        FAIL() << "must throw";
    } catch (const BoardError& error) {
        EXPECT_NE(std::string(error.what()).find("0cec:0203"), std::string::npos) << error.what();
        EXPECT_NE(std::string(error.what()).find("stalled"), std::string::npos) << error.what();
    }
}

TEST_F(SimpleBoardTest, FirmwareAnswersNothingToWhatIsNoCommandAndKeepsItsMotors) {
    board.start();
    ASSERT_EQ(board.exchange({kSimpleDacCodes}, reading, 0), ExchangeStatus::Ok);
    std::array<std::byte, 512> in{};
    for (const auto& wrong : {bytes({0x51}, 31), bytes({0x51}, 33), bytes({0x51}, 512), bytes({}), bytes({0x53}, 32),
                              bytes({0xA2, 0x1B, 0xFF}, 32), bytes({0x52, 0x00, 0x10}, 32)}) {
        firmware.receive(wrong, 0);
        EXPECT_EQ(firmware.reply(in, 0), 0U);
        EXPECT_EQ(device.dac_codes(), kSimpleDacCodes);
    }
}

TEST_F(SimpleBoardTest, FirmwareAnswersEachLatchOnceAndTheOldestFirst) {
    board.start();
    firmware.receive(bytes({0x51}, 32), 0);
    firmware.receive(bytes({0x51}, 32), 2'000'000);
    std::array<std::byte, 512> in{};
    SimpleReply reply;
    ASSERT_EQ(firmware.reply(in, 0), 32U);
    ASSERT_EQ(decode(std::span<const std::byte>(in).first(32), reply), PacketDefect::None);
    EXPECT_EQ(reply.counters[0], 0U);
    ASSERT_EQ(firmware.reply(in, 0), 32U);
    ASSERT_EQ(decode(std::span<const std::byte>(in).first(32), reply), PacketDefect::None);
    EXPECT_EQ(reply.counters[0], static_cast<std::uint32_t>(counts_of_a_step_to_the_right(0)));
    EXPECT_EQ(firmware.reply(in, 0), 0U);
}

TEST(SimpleBoard, OfAGeometryIsStartedWhereTheDeviceIsEmulated) {
    EmulatedBoard board(simple_settings());
    BoardReading reading;
    ASSERT_EQ(board.exchange({kSimpleDacCodes}, reading, 0), ExchangeStatus::Ok);
    EXPECT_EQ(reading.counters, (std::array<std::uint32_t, kStrings>{}));
    EXPECT_EQ(board.device().dac_codes(), kSimpleDacCodes);
}

}  // namespace
}  // namespace haptic::device
