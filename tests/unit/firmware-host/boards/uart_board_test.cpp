#include "boards/uart_board.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <stdexcept>

#include "bytes.hpp"
#include "codecs/uart_codec.hpp"
#include "emulated/uart_firmware.hpp"
#include "haptic/device/emulated_board.hpp"
#include "haptic/device/emulated_device.hpp"
#include "rough_cable.hpp"
#include "sample_device.hpp"

namespace haptic::device {
namespace {

using test::Bytes;
using test::bytes;
using test::counts_of_a_step_to_the_right;
using test::kPowerUp;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr std::array<std::int16_t, kStrings> kUartDacCodes = {45, -46, 47, -48, 4095, -4095, 0, 1};

EmulatedDevice::Settings uart_settings(std::vector<int> boards) {
    const Quat level(1.0, 0.0, 0.0, 0.0);
    DeviceGeometry geometry = spidar_g6_x3r();
    geometry.board = BoardKind::Uart;
    geometry.uart_boards = std::move(boards);
    return {.geometry = geometry,
            .hand = PoseTrack({0.0, 0.001}, {{{0.0, 0.0, 0.0}, level}, {{0.02, 0.0, 0.0}, level}}),
            .power_up = kPowerUp};
}

class UartBoardTest : public testing::TestWithParam<std::vector<int>> {
  protected:
    EmulatedDevice device{uart_settings(GetParam())};
    UartFirmware firmware{device};
    test::RoughCable cable{firmware};
    UartBoard board{cable};
    BoardReading reading;
};

INSTANTIATE_TEST_SUITE_P(Boards, UartBoardTest, testing::Values(std::vector<int>{8}, std::vector<int>{4, 4}),
                         [](const auto& param) { return param.param.size() == 1 ? "OneOfEight" : "TwoOfFour"; });

TEST_P(UartBoardTest, SetsAllMotorsAndReadsAllEncodersInTheHostsSense) {
    board.start();
    ASSERT_EQ(board.exchange({kUartDacCodes}, reading, 0), ExchangeStatus::Ok);
    EXPECT_EQ(device.dac_codes(), kUartDacCodes);
    EXPECT_EQ(reading.counters, kPowerUp);
    ASSERT_EQ(board.exchange({kUartDacCodes}, reading, 2'000'000), ExchangeStatus::Ok);
    for (std::size_t i = 0; i < kStrings; ++i) {
        EXPECT_EQ(reading.counters[i],
                  (kPowerUp[i] + static_cast<std::uint32_t>(counts_of_a_step_to_the_right(i))) & 0xFFFFU)
            << i;
    }
}

TEST_P(UartBoardTest, ClampsCurrents) {
    board.start();
    ASSERT_EQ(board.exchange({{4096, -4096, 32767, -32768, 1, -1, 0, 4095}}, reading, 0), ExchangeStatus::Ok);
    EXPECT_EQ(device.dac_codes(), (std::array<std::int16_t, kStrings>{4095, -4095, 4095, -4095, 1, -1, 0, 4095}));
}

TEST_P(UartBoardTest, IsReadyAgainAfterACommandThatWasHalfSent) {
    board.start();
    firmware.receive(bytes({0x30, 0x10, 0x10, 0x10}), 0);
    board.start();
    EXPECT_EQ(board.exchange({kUartDacCodes}, reading, 0), ExchangeStatus::Ok);
}

TEST_P(UartBoardTest, ZeroesTheMotorsEvenInTheMiddleOfACommand) {
    board.start();
    ASSERT_EQ(board.exchange({kUartDacCodes}, reading, 0), ExchangeStatus::Ok);
    firmware.receive(bytes({0x30, 0x10, 0x00, 0x10}), 0);
    board.zero_motors(0);
    EXPECT_EQ(device.dac_codes(), (std::array<std::int16_t, kStrings>{}));
}

TEST_P(UartBoardTest, LeavesTheReadingOnAShortAnswerAndIsReadyAgainAtTheNext) {
    board.start();
    ASSERT_EQ(board.exchange({kUartDacCodes}, reading, 0), ExchangeStatus::Ok);
    const BoardReading before = reading;
    for (const std::size_t length : {1U, 16U, 33U}) {
        cable.change = [&](std::span<std::byte>) { return length; };
        EXPECT_EQ(board.exchange({kUartDacCodes}, reading, 2'000'000), ExchangeStatus::Short);
        EXPECT_EQ(reading, before);
        cable.change = nullptr;
        ASSERT_EQ(board.exchange({kUartDacCodes}, reading, 0), ExchangeStatus::Ok);
    }
}

TEST_P(UartBoardTest, EveryFlippedBitOfAHeaderIsFound) {
    board.start();
    ASSERT_EQ(board.exchange({kUartDacCodes}, reading, 0), ExchangeStatus::Ok);
    const std::size_t second = GetParam().size() == 2 ? 17 : 0;  // offset of its header
    for (const std::size_t at : {std::size_t{0}, second}) {
        for (unsigned bit = 0; bit < 8; ++bit) {
            int answers = 0;
            cable.change = [&](std::span<std::byte> in) {
                if (++answers == 1) {
                    in[at] ^= static_cast<std::byte>(1U << bit);
                }
                return in.size();
            };
            const BoardReading before = reading;
            EXPECT_EQ(board.exchange({kUartDacCodes}, reading, 2'000'000), ExchangeStatus::Malformed);
            EXPECT_EQ(reading, before);
            EXPECT_EQ(board.exchange({kUartDacCodes}, reading, 2'000'000), ExchangeStatus::Ok);
        }
    }
}

TEST_P(UartBoardTest, TakesNoOldAnswerForANewOneAfterATimeOut) {
    board.start();
    ASSERT_EQ(board.exchange({}, reading, 0), ExchangeStatus::Ok);
    cable.answers_held_back = 1;
    EXPECT_EQ(board.exchange({}, reading, 500'000), ExchangeStatus::Timeout);
    ASSERT_EQ(board.exchange({}, reading, 2'000'000), ExchangeStatus::Ok);
    EXPECT_EQ(reading.counters[0],
              (kPowerUp[0] + static_cast<std::uint32_t>(counts_of_a_step_to_the_right(0))) & 0xFFFFU);
}

TEST_P(UartBoardTest, EndsWhereTheLineIsGone) {
    board.start();
    cable.next_status = ExchangeStatus::Disconnected;
    EXPECT_EQ(board.exchange({}, reading, 0), ExchangeStatus::Disconnected);
    EXPECT_THAT([&] { board.start(); }, ThrowsMessage<BoardError>(HasSubstr("disconnected")));
    EXPECT_EQ(board.exchange({}, reading, 0), ExchangeStatus::Disconnected) << "not started";
    const std::size_t before = cable.sent.size();
    board.zero_motors(0);
    EXPECT_EQ(cable.sent.size(), before);
}

TEST(UartBoard, GoldenBytesOfAnExchangeWithOneBoardOfEight) {
    EmulatedDevice device(uart_settings({8}));
    UartFirmware firmware(device);
    test::RoughCable cable(firmware);
    UartBoard board(cable);
    board.start();
    cable.sent.clear();
    BoardReading reading;
    MotorCommand command;
    command.dac_codes.fill(45);
    ASSERT_EQ(board.exchange(command, reading, 0), ExchangeStatus::Ok);
    ASSERT_EQ(cable.sent.size(), 1U);
    // 17 bytes, then 41 - 17 + 20 zeros.
    EXPECT_EQ(cable.sent[0],
              bytes({0x30, 0x2D, 0, 0x2D, 0, 0x2D, 0, 0x2D, 0, 0x2D, 0, 0x2D, 0, 0x2D, 0, 0x2D, 0}, 17 + 44));
}

TEST(UartBoard, GoldenBytesOfAnExchangeWithTwoBoardsOfFour) {
    EmulatedDevice device(uart_settings({4, 4}));
    UartFirmware firmware(device, {{2, kUartB3M}, {6, kUartB3M}});
    test::RoughCable cable(firmware);
    UartBoard board(cable);
    board.start();
    EXPECT_EQ(board.found(), "id 2: model 5, 4 motors; id 6: model 5, 4 motors");
    EXPECT_EQ(board.packets(), exchange_packets(BoardKind::Uart, {}));
    cable.sent.clear();
    BoardReading reading;
    ASSERT_EQ(board.exchange({{1, 2, 3, 4, -1, -2, -3, -4}}, reading, 0), ExchangeStatus::Ok);
    // For each board 9 bytes, then 17 - 9 + 20 zeros.
    Bytes golden = bytes({0x32, 1, 0, 2, 0, 3, 0, 4, 0}, 37);
    const Bytes second = bytes({0x36, 0xFF, 0xFF, 0xFE, 0xFF, 0xFD, 0xFF, 0xFC, 0xFF}, 37);
    golden.insert(golden.end(), second.begin(), second.end());
    ASSERT_EQ(cable.sent.size(), 1U);
    EXPECT_EQ(cable.sent[0], golden);
}

TEST(UartBoard, StartAsksEveryIdAndTellsTheBoardsOfOneAnother) {
    EmulatedDevice device(uart_settings({4, 4}));
    UartFirmware firmware(device, {{1, kUartB3M}, {4, kUartB3M}});
    test::RoughCable cable(firmware);
    UartBoard board(cable);
    board.start();
    ASSERT_EQ(cable.sent.size(), 1U + 8U + 2U);
    EXPECT_EQ(cable.sent[0], Bytes(85));
    for (int id = 0; id < 8; ++id) {
        EXPECT_EQ(cable.sent[1 + static_cast<std::size_t>(id)], bytes({8 + id}, 27));
    }
    EXPECT_EQ(cable.sent[9], bytes({0x11, 1, 1, 13, 21, 1, 17, 9, 12, 12, 18, 3, 2}, 18));
    EXPECT_EQ(cable.sent[10], bytes({0x14, 1, 1, 13, 21, 1, 17, 9, 12, 12, 18, 3, 2}, 18));
}

TEST(UartBoard, BoardsThatWereNotToldOfOneAnotherMisread) {
    EmulatedDevice device(uart_settings({4, 4}));
    UartFirmware firmware(device);
    test::RoughCable cable(firmware);
    UartBoard board(cable, {.set_lengths = false});
    board.start();
    BoardReading reading;
    // To board 1 the low byte 9 of a current of board 0 looks like a request for its info.
    EXPECT_NE(board.exchange({{9, 0, 0, 0, 5, 6, 7, 8}}, reading, 0), ExchangeStatus::Ok);
    UartBoard careful(cable);
    careful.start();
    EXPECT_EQ(careful.exchange({{9, 0, 0, 0, 5, 6, 7, 8}}, reading, 0), ExchangeStatus::Ok);
}

TEST(UartBoard, TooFewZerosLeaveAnAnswerBehind) {
    EmulatedDevice device(uart_settings({8}));
    UartFirmware firmware(device);
    test::RoughCable cable(firmware);
    BoardReading reading;
    UartBoard enough(cable, {.padding = 17});  // 41 zeros for 41 bytes
    enough.start();
    EXPECT_EQ(enough.exchange({}, reading, 0), ExchangeStatus::Ok);
    UartBoard fewer(cable, {.padding = 16});
    fewer.start();
    EXPECT_EQ(fewer.exchange({}, reading, 0), ExchangeStatus::Short);
}

TEST(UartBoard, SaysWhatIsOnALineWithoutEightMotors) {
    EmulatedDevice device(uart_settings({4, 4}));
    UartFirmware one(device, {{3, kUartB3M}});
    test::RoughCable cable(one);
    UartBoard board(cable);
    EXPECT_THAT([&] { board.start(); },
                ThrowsMessage<BoardError>(testing::AllOf(HasSubstr("id 3: model 5, 4 motors"), HasSubstr("power"))));
    UartFirmware none(device, {});
    test::RoughCable silent(none);
    UartBoard lonely(silent);
    EXPECT_THAT([&] { lonely.start(); }, ThrowsMessage<BoardError>(HasSubstr("nothing")));
    // Each id is waited for during five time limits: the command, then four more reads.
    EXPECT_EQ(silent.exchanges, 1 + 8 * 5);
}

TEST(UartBoard, SaysWhereAnAnswerIsNoBoardInfo) {
    EmulatedDevice device(uart_settings({8}));
    UartFirmware firmware(device);
    test::RoughCable cable(firmware);
    UartBoard board(cable);
    cable.change = [](std::span<std::byte> in) {
        in[0] = std::byte{0xFF};  // as when two boards transmit at once
        return in.size();
    };
    EXPECT_THAT([&] { board.start(); }, ThrowsMessage<BoardError>(HasSubstr("share this id")));
}

TEST(UartBoard, AsksOnceMoreWhereAnAnswerIsNoBoardInfo) {
    EmulatedDevice device(uart_settings({8}));
    UartFirmware firmware(device);
    test::RoughCable cable(firmware);
    UartBoard board(cable);
    bool first = true;
    cable.change = [&](std::span<std::byte> in) {
        in[0] = first ? std::byte{0xFF} : in[0];
        first = false;
        return in.size();
    };
    board.start();
    EXPECT_EQ(board.found(), "id 0: model 7, 8 motors");
    EXPECT_EQ(board.packets(), (ExchangePackets{{61, 0}, 41}));
}

TEST(UartFirmware, ClocksAByteOutForEachThatFollowsTheCommand) {
    EmulatedDevice device(uart_settings({8}));
    UartFirmware firmware(device);
    std::array<std::byte, 100> in{};
    firmware.receive(bytes({0x08}), 0);
    EXPECT_EQ(firmware.reply(in, 0), 0U);
    for (int k = 0; k < 7; ++k) {
        firmware.receive(bytes({0x00}), 0);
        EXPECT_EQ(firmware.reply(in, 0), 1U);
    }
    firmware.receive(bytes({0, 0, 0}), 0);
    EXPECT_EQ(firmware.reply(in, 0), 0U);
}

TEST(UartFirmware, AnswersAllTheSameHoweverTheStreamIsCut) {
    const auto answer_to_parts_of = [](std::size_t part) {
        EmulatedDevice device(uart_settings({4, 4}));
        UartFirmware firmware(device);
        test::RoughCable cable(firmware);
        UartBoard board(cable);
        board.start();
        const Bytes out = bytes({0x30, 1, 0, 2, 0, 3, 0, 4, 0, 0, 0x31, 5, 0, 6, 0, 7, 0, 8, 0}, 60);
        Bytes all;
        for (std::size_t at = 0; at < out.size(); at += part) {
            firmware.receive(std::span(out).subspan(at, std::min(part, out.size() - at)), 0);
            std::array<std::byte, 5> in{};
            for (std::size_t count = firmware.reply(in, 0); count > 0; count = firmware.reply(in, 0)) {
                all.insert(all.end(), in.begin(), in.begin() + static_cast<std::ptrdiff_t>(count));
            }
        }
        return all;
    };
    const Bytes whole = answer_to_parts_of(60);
    EXPECT_EQ(whole.size(), 34U);
    for (const std::size_t part : {1U, 2U, 3U, 7U, 19U}) {
        EXPECT_EQ(answer_to_parts_of(part), whole) << part;
    }
}

TEST(UartFirmware, KeepsItsMotorsOnACurrentBeyondItsRange) {
    EmulatedDevice device(uart_settings({8}));
    UartFirmware firmware(device);
    device.set_dac_codes(kUartDacCodes);
    firmware.receive(bytes({0x30, 0x00, 0x10}, 80), 0);
    EXPECT_EQ(device.dac_codes(), kUartDacCodes);
    std::array<std::byte, 100> in{};
    EXPECT_EQ(firmware.reply(in, 0), 0U);
}

TEST(UartFirmware, LosesWholeAnswersWhereNobodyFetchesThem) {
    EmulatedDevice device(uart_settings({8}));
    UartFirmware firmware(device);
    for (int k = 0; k < 1000; ++k) {
        firmware.receive(bytes({0x30}, 17 + 44), 0);
    }
    std::array<std::byte, 41> in{};
    int answers = 0;
    while (firmware.reply(in, 0) == in.size()) {
        ++answers;
        EXPECT_EQ(in[0], std::byte{0x30});
    }
    EXPECT_EQ(answers, 12) << "512 bytes have room for that many";
}

TEST(UartFirmware, RefusesLinesThatCannotBe) {
    EmulatedDevice device(uart_settings({8}));
    EXPECT_THROW(UartFirmware(device, {{0, kUartB3M}, {0, kUartB3M}}), std::invalid_argument);
    EXPECT_THROW(UartFirmware(device, {{8, kUartB3M}}), std::invalid_argument);
    EXPECT_THROW(UartFirmware(device, {{0, kUartB5M}, {1, kUartB3M}}), std::invalid_argument);
    for (const std::vector<int>& boards : {std::vector<int>{}, std::vector<int>{4}, std::vector<int>{3, 5}}) {
        EmulatedDevice wrong(uart_settings(boards));
        EXPECT_THROW(UartFirmware{wrong}, std::invalid_argument);
    }
}

TEST(UartBoard, OfAGeometryIsStartedWhereTheDeviceIsEmulated) {
    EmulatedBoard board(uart_settings({4, 4}));
    BoardReading reading;
    ASSERT_EQ(board.exchange({kUartDacCodes}, reading, 0), ExchangeStatus::Ok);
    EXPECT_EQ(reading.counters, kPowerUp);
    EXPECT_EQ(board.device().dac_codes(), kUartDacCodes);
}

}  // namespace
}  // namespace haptic::device
