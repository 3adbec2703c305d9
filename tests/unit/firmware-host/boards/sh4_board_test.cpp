#include "boards/sh4_board.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "bytes.hpp"
#include "codecs/sh4_codec.hpp"
#include "emulated/sh4_firmware.hpp"
#include "haptic/device/emulated_board.hpp"
#include "haptic/device/emulated_device.hpp"
#include "rough_cable.hpp"
#include "sample_device.hpp"

namespace haptic::device {
namespace {

using test::Bytes;
using test::kPowerUp;

constexpr std::array<std::int16_t, kStrings> kSh4DacCodes = {45, 46, 47, 48, 49, 50, 51, 4095};

EmulatedDevice::Settings sh4_settings() {
    return {.geometry = spidar_g6_x3r(), .power_up = kPowerUp, .rotary = 0xA};
}

Sh4Packet command_packet(const std::array<std::uint16_t, kStrings>& dac_codes) {
    Sh4Packet out;
    encode(Sh4Command{dac_codes}, out);
    return out;
}

class Sh4FirmwareTest : public testing::Test {
  protected:
    /// Reply of the board to a packet; empty if none.
    Sh4Reply reply_to(const Sh4Packet& out) {
        firmware.receive(out, 0);
        Sh4Packet in;
        Sh4Reply reply;
        EXPECT_EQ(firmware.reply(in, 0), in.size());
        EXPECT_EQ(decode(std::span<const std::byte>(in), reply), PacketDefect::None);
        return reply;
    }

    EmulatedDevice device{sh4_settings()};
    Sh4Firmware firmware{device};
};

TEST_F(Sh4FirmwareTest, EchoesTheDacCodesOfTheSamePacket) {
    const std::array<std::uint16_t, kStrings> first = {45, 46, 47, 48, 49, 50, 51, 52};
    const std::array<std::uint16_t, kStrings> second = {4095, 0, 1, 2, 3, 4, 5, 6};
    EXPECT_EQ(reply_to(command_packet(first)).dac_codes, first);
    EXPECT_EQ(reply_to(command_packet(second)).dac_codes, second);
    EXPECT_EQ(device.dac_codes()[0], 4095);
}

TEST_F(Sh4FirmwareTest, ReportsButtonsAndRotarySwitch) {
    EXPECT_EQ(reply_to(command_packet({})).pio, 0x00A0);
    device.set_buttons(0x5);
    EXPECT_EQ(reply_to(command_packet({})).pio, 0x00A5);
    device.set_buttons(0xFF);  // three switches exist
    EXPECT_EQ(reply_to(command_packet({})).pio, 0x00A7);
}

TEST_F(Sh4FirmwareTest, AnswersEachCommandOnce) {
    reply_to(command_packet({}));
    Sh4Packet in;
    EXPECT_EQ(firmware.reply(in, 0), 0U);
}

TEST_F(Sh4FirmwareTest, AnswersNothingToWhatIsNoCommandAndKeepsItsMotors) {
    reply_to(command_packet({45, 45, 45, 45, 45, 45, 45, 45}));
    const auto before = device.dac_codes();
    Sh4Packet opcode = command_packet({});
    opcode[1] = std::byte{0x0D};
    Sh4Packet beyond = command_packet({});
    beyond[3] = std::byte{0x10};
    const Sh4Packet whole = command_packet({});
    Sh4Packet in;
    for (const std::span<const std::byte> wrong :
         {std::span<const std::byte>(opcode), std::span<const std::byte>(beyond),
          std::span<const std::byte>(whole).first(511), std::span<const std::byte>()}) {
        firmware.receive(wrong, 0);
        EXPECT_EQ(firmware.reply(in, 0), 0U);
        EXPECT_EQ(device.dac_codes(), before);
    }
}

TEST(Sh4Board, BringsCountersButtonsAndRotaryOfTheDevice) {
    EmulatedBoard board(sh4_settings());
    board.device().set_buttons(0x3);
    BoardReading reading;
    ASSERT_EQ(board.exchange({kSh4DacCodes}, reading, 0), ExchangeStatus::Ok);
    EXPECT_EQ(reading.counters, kPowerUp);
    EXPECT_EQ(reading.buttons, 0x3U);
    EXPECT_EQ(reading.rotary, 0xA);
    EXPECT_EQ(board.device().dac_codes(), kSh4DacCodes);
}

TEST(Sh4Board, ClampsDacCodesToTheRangeOfItsUnsignedDac) {
    EmulatedBoard board(sh4_settings());
    BoardReading reading;
    ASSERT_EQ(board.exchange({{-5, -4095, 7, 4096, 32767, -32768, 0, 0}}, reading, 0), ExchangeStatus::Ok);
    EXPECT_EQ(board.device().dac_codes(), (std::array<std::int16_t, kStrings>{0, 0, 7, 4095, 4095, 0, 0, 0}));
}

TEST(Sh4Board, ZeroesTheMotors) {
    EmulatedBoard board(sh4_settings());
    BoardReading reading;
    ASSERT_EQ(board.exchange({kSh4DacCodes}, reading, 0), ExchangeStatus::Ok);
    board.zero_motors(0);
    EXPECT_EQ(board.device().dac_codes(), (std::array<std::int16_t, kStrings>{}));
}

/// A board on a cable that misbehaves on command. The hand moves from the centre 20 mm to the right within a second, so
/// that the counters show when they were latched.
class Sh4BoardTest : public testing::Test {
  protected:
    static EmulatedDevice::Settings moving() {
        const Quat level(1.0, 0.0, 0.0, 0.0);
        EmulatedDevice::Settings result = sh4_settings();
        result.hand = PoseTrack({0.0, 1.0}, {{{0.0, 0.0, 0.0}, level}, {{0.02, 0.0, 0.0}, level}});
        result.power_up = {};
        return result;
    }
    /// One exchange with the same DAC code for all motors.
    ExchangeStatus exchange(int dac_code) {
        now_ns += 100'000'000;
        MotorCommand command;
        command.dac_codes.fill(static_cast<std::int16_t>(dac_code));
        return board.exchange(command, reading, now_ns);
    }
    /// Whether the counters are those of the last exchange.
    testing::AssertionResult fresh() {
        const BoardReading old = reading;
        device.advance(now_ns);
        return old.counters == device.counters() ? testing::AssertionSuccess()
                                                 : testing::AssertionFailure() << "counters of another time";
    }
    static Bytes command_of(int dac_code) {
        Sh4Command command;
        command.dac_codes.fill(static_cast<std::uint16_t>(dac_code));
        Sh4Packet out;
        encode(command, out);
        return Bytes(out.begin(), out.end());
    }

    EmulatedDevice device{moving()};
    Sh4Firmware firmware{device};
    test::RoughCable cable{firmware};
    Sh4Board board{cable};
    BoardReading reading;
    std::int64_t now_ns = 0;
};

TEST_F(Sh4BoardTest, ThrowsAwayAnAnswerToAnEarlierSession) {
    firmware.receive(command_of(77), 0);
    board.start();
    EXPECT_EQ(exchange(0), ExchangeStatus::Ok);
    EXPECT_EQ(exchange(45), ExchangeStatus::Ok);
    EXPECT_TRUE(fresh());
    EXPECT_EQ(cable.exchanges, 2);
}

TEST_F(Sh4BoardTest, TakesNoAnswerToAnotherCommandAndCatchesUp) {
    firmware.receive(command_of(77), 0);  // from another session, and not drained
    const BoardReading untouched = reading;
    EXPECT_EQ(exchange(1), ExchangeStatus::Stale);
    EXPECT_EQ(reading, untouched);
    EXPECT_EQ(exchange(2), ExchangeStatus::Ok);
    EXPECT_TRUE(fresh());
    const int before = cable.exchanges;
    EXPECT_EQ(exchange(3), ExchangeStatus::Ok);
    EXPECT_TRUE(fresh());
    EXPECT_EQ(cable.exchanges, before + 1) << "it has caught up";
}

TEST_F(Sh4BoardTest, CatchesUpWithinTheExchangeAfterAnAnswerThatCameTooLate) {
    EXPECT_EQ(exchange(1), ExchangeStatus::Ok);
    cable.answers_held_back = 1;
    EXPECT_EQ(exchange(2), ExchangeStatus::Timeout);
    EXPECT_EQ(exchange(3), ExchangeStatus::Ok);
    EXPECT_TRUE(fresh());
}

TEST_F(Sh4BoardTest, CatchesUpAPacketAnExchangeAndNeverFetchesMoreThanOneMore) {
    EXPECT_EQ(exchange(1), ExchangeStatus::Ok);
    cable.answers_held_back = 3;
    for (const int dac_code : {2, 3, 4}) {
        EXPECT_EQ(exchange(dac_code), ExchangeStatus::Timeout);
    }
    // Three are queued and a fourth arrives: each exchange fetches two.
    for (const int dac_code : {5, 6}) {
        const int before = cable.exchanges;
        EXPECT_EQ(exchange(dac_code), ExchangeStatus::Stale);
        EXPECT_EQ(cable.exchanges, before + 2);
    }
    EXPECT_EQ(exchange(7), ExchangeStatus::Ok);
    EXPECT_TRUE(fresh());
}

TEST_F(Sh4BoardTest, RepeatedAnswerIsFoundByItsEcho) {
    EXPECT_EQ(exchange(1), ExchangeStatus::Ok);
    firmware.receive(command_of(1), now_ns);  // the same packet again, as a repeated one
    EXPECT_EQ(exchange(2), ExchangeStatus::Ok);
    EXPECT_TRUE(fresh());
}

TEST_F(Sh4BoardTest, EveryFlippedBitOfTheEchoIsFound) {
    EXPECT_EQ(exchange(0x555), ExchangeStatus::Ok);
    for (std::size_t bit = 0; bit < 128; ++bit) {
        const BoardReading before = reading;
        cable.change = [&](std::span<std::byte> in) {
            in[bit / 8] ^= static_cast<std::byte>(1U << (bit % 8));
            return in.size();
        };
        ASSERT_EQ(exchange(0x555), ExchangeStatus::Stale) << bit;
        ASSERT_EQ(reading, before);
    }
    cable.change = nullptr;
    EXPECT_EQ(exchange(0x555), ExchangeStatus::Ok);
}

TEST_F(Sh4BoardTest, LeavesTheReadingOnAnAnswerOfAnotherLength) {
    EXPECT_EQ(exchange(1), ExchangeStatus::Ok);
    const BoardReading before = reading;
    for (const std::size_t length : {1U, 54U, 511U}) {
        cable.change = [&](std::span<std::byte>) { return length; };
        EXPECT_EQ(exchange(2), ExchangeStatus::Short);
        EXPECT_EQ(reading, before);
    }
}

TEST_F(Sh4BoardTest, TakesABoardWithoutEchoOnlyWhereItIsToldNotToLook) {
    cable.change = [](std::span<std::byte> in) {
        std::fill_n(in.begin(), 16, std::byte{0xFF});
        return in.size();
    };
    EXPECT_EQ(exchange(45), ExchangeStatus::Stale);
    Sh4Board trusting(cable, false);
    ASSERT_EQ(trusting.exchange({}, reading, now_ns), ExchangeStatus::Ok);
}

TEST_F(Sh4BoardTest, WithoutAnEchoAnOverdueAnswerIsFetchedBeforeTheNextCommand) {
    Sh4Board trusting(cable, false);
    cable.answers_held_back = 1;
    EXPECT_EQ(trusting.exchange({}, reading, 0), ExchangeStatus::Timeout);
    now_ns = 500'000'000;
    EXPECT_EQ(trusting.exchange({}, reading, now_ns), ExchangeStatus::Ok);
    EXPECT_TRUE(fresh());
    // A reply that never comes costs one more wait and nothing else.
    cable.next_status = ExchangeStatus::Timeout;
    EXPECT_EQ(trusting.exchange({}, reading, now_ns), ExchangeStatus::Timeout);
    cable.next_status = ExchangeStatus::Ok;
    const int before = cable.exchanges;
    EXPECT_EQ(trusting.exchange({}, reading, now_ns), ExchangeStatus::Ok);
    EXPECT_EQ(cable.exchanges, before + 2);
}

TEST_F(Sh4BoardTest, SendsWithoutWaitingAndCollectsTheAnswerLater) {
    EXPECT_EQ(board.collect(now_ns), ExchangeStatus::Ok) << "nothing is due";
    const int before = cable.exchanges;
    ASSERT_EQ(board.send({kSh4DacCodes}, now_ns), ExchangeStatus::Ok);
    EXPECT_EQ(device.dac_codes(), kSh4DacCodes);
    EXPECT_TRUE(board.answer_due());
    EXPECT_EQ(board.collect(now_ns + 1'000'000), ExchangeStatus::Ok);
    EXPECT_FALSE(board.answer_due());
    EXPECT_EQ(cable.exchanges, before + 2);
    EXPECT_EQ(exchange(2), ExchangeStatus::Ok);
    EXPECT_TRUE(fresh());
}

TEST_F(Sh4BoardTest, FindsTheAnswerToASentCommandLostLateOrWrong) {
    // Late: a time-out, and the next exchange catches up.
    cable.answers_held_back = 1;
    ASSERT_EQ(board.send({kSh4DacCodes}, now_ns), ExchangeStatus::Ok);
    EXPECT_EQ(board.collect(now_ns), ExchangeStatus::Timeout);
    EXPECT_EQ(exchange(2), ExchangeStatus::Ok);
    EXPECT_TRUE(fresh());
    // Short.
    ASSERT_EQ(board.send({kSh4DacCodes}, now_ns), ExchangeStatus::Ok);
    cable.change = [](std::span<std::byte>) { return std::size_t{511}; };
    EXPECT_EQ(board.collect(now_ns), ExchangeStatus::Short);
    // With an echo that was never sent.
    cable.change = [](std::span<std::byte> in) {
        in[0] ^= std::byte{1};
        return in.size();
    };
    ASSERT_EQ(board.send({kSh4DacCodes}, now_ns), ExchangeStatus::Ok);
    EXPECT_EQ(board.collect(now_ns), ExchangeStatus::Stale);
    cable.change = nullptr;
    // Not even sent.
    cable.next_status = ExchangeStatus::Stalled;
    EXPECT_EQ(board.send({kSh4DacCodes}, now_ns), ExchangeStatus::Stalled);
    EXPECT_FALSE(board.answer_due());
    cable.next_status = ExchangeStatus::Ok;
    EXPECT_EQ(exchange(3), ExchangeStatus::Ok);
    EXPECT_TRUE(fresh());
}

TEST_F(Sh4BoardTest, AnExchangeAfterASentCommandDoesNotTakeItsAnswer) {
    for (const bool echo : {true, false}) {
        Sh4Board other(cable, echo);
        other.start();
        ASSERT_EQ(other.send({}, 0), ExchangeStatus::Ok);
        ASSERT_EQ(other.exchange({}, reading, 500'000'000), ExchangeStatus::Ok);
        const BoardReading found = reading;
        ASSERT_EQ(other.exchange({}, reading, 500'000'000), ExchangeStatus::Ok);
        EXPECT_EQ(found, reading) << echo << ": the counters of the second command, though the codes are the same";
        // So does a second send: its answer is the one that is collected.
        ASSERT_EQ(other.send({}, 0), ExchangeStatus::Ok);
        ASSERT_EQ(other.send({kSh4DacCodes}, 0), ExchangeStatus::Ok);
        EXPECT_EQ(other.collect(0), ExchangeStatus::Ok);
        EXPECT_FALSE(other.answer_due());
    }
}

TEST_F(Sh4BoardTest, WithoutAnEchoSendsNothingWhileAnAnswerIsOverdue) {
    Sh4Board trusting(cable, false);
    cable.answers_held_back = 1;
    EXPECT_EQ(trusting.exchange({}, reading, 0), ExchangeStatus::Timeout);
    const int before = cable.exchanges;
    EXPECT_EQ(trusting.send({kSh4DacCodes}, 0), ExchangeStatus::Timeout);
    EXPECT_EQ(cable.exchanges, before) << "it does not wait either";
    EXPECT_EQ(trusting.exchange({kSh4DacCodes}, reading, 500'000'000), ExchangeStatus::Ok);
    EXPECT_EQ(trusting.send({}, 500'000'000), ExchangeStatus::Ok);
    EXPECT_EQ(trusting.collect(500'000'000), ExchangeStatus::Ok);
}

}  // namespace
}  // namespace haptic::device
