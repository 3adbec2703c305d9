#include "haptic/device/sh4_board.hpp"

#include <gtest/gtest.h>

#include <array>

#include "haptic/device/emulated_board.hpp"

namespace haptic::device {
namespace {

constexpr std::array<std::uint32_t, kStrings> kPowerUp = {0, 65535, 32768, 12345, 1, 40000, 7, 60000};
constexpr std::array<std::int16_t, kStrings> kDigits = {45, 46, 47, 48, 49, 50, 51, 4095};

EmulatedDevice::Settings settings() {
    return {.variant = spidar_g6_x3r(), .power_up = kPowerUp, .rotary = 0xA};
}

Sh4Packet command_packet(const std::array<std::uint16_t, kStrings>& digits) {
    Sh4Packet out;
    encode(Sh4Command{digits}, out);
    return out;
}

class Sh4FirmwareTest : public testing::Test {
  protected:
    /// What the board answers to a packet; nothing is an empty reply.
    Sh4Reply reply_to(const Sh4Packet& out) {
        firmware.receive(out, 0);
        Sh4Packet in;
        Sh4Reply reply;
        EXPECT_EQ(firmware.reply(in, 0), in.size());
        EXPECT_EQ(decode(std::span<const std::byte>(in), reply), PacketDefect::None);
        return reply;
    }

    EmulatedDevice device{settings()};
    Sh4Firmware firmware{device};
};

TEST_F(Sh4FirmwareTest, EchoesTheDigitsOfTheSamePacket) {
    const std::array<std::uint16_t, kStrings> first = {45, 46, 47, 48, 49, 50, 51, 52};
    const std::array<std::uint16_t, kStrings> second = {4095, 0, 1, 2, 3, 4, 5, 6};
    EXPECT_EQ(reply_to(command_packet(first)).digits, first);
    EXPECT_EQ(reply_to(command_packet(second)).digits, second);
    EXPECT_EQ(device.digits()[0], 4095);
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
    const auto before = device.digits();
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
        EXPECT_EQ(device.digits(), before);
    }
}

TEST(Sh4Board, BringsCountersButtonsAndRotaryOfTheDevice) {
    EmulatedBoard board(settings());
    board.device().set_buttons(0x3);
    BoardReading reading;
    ASSERT_EQ(board.exchange({kDigits}, reading, 0), ExchangeStatus::Ok);
    EXPECT_EQ(reading.counters, kPowerUp);
    EXPECT_EQ(reading.buttons, 0x3U);
    EXPECT_EQ(reading.rotary, 0xA);
    EXPECT_EQ(board.device().digits(), kDigits);
}

TEST(Sh4Board, SendsZeroForADigitThatItsUnsignedConverterCannotMake) {
    EmulatedBoard board(settings());
    BoardReading reading;
    ASSERT_EQ(board.exchange({{-5, -4095, 7, 0, 0, 0, 0, 0}}, reading, 0), ExchangeStatus::Ok);
    EXPECT_EQ(board.device().digits(), (std::array<std::int16_t, kStrings>{0, 0, 7}));
}

TEST(Sh4Board, ZeroesTheMotors) {
    EmulatedBoard board(settings());
    BoardReading reading;
    ASSERT_EQ(board.exchange({kDigits}, reading, 0), ExchangeStatus::Ok);
    board.zero_motors(0);
    EXPECT_EQ(board.device().digits(), (std::array<std::int16_t, kStrings>{}));
}

}  // namespace
}  // namespace haptic::device
