// Zeros over USB, past a driver that has transfers in flight and does nothing any more.
#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "codecs/sh4_codec.hpp"
#include "fake_usbfs.hpp"
#include "haptic/device/usb_board.hpp"
#include "haptic/device/zero_packet.hpp"

namespace haptic::device {
namespace {

using Fault = test::FakeUsbBoard::Fault;

constexpr std::array<std::int16_t, kStrings> kZeros{};

class PullingUsbBoard : public testing::Test {
  protected:
    void SetUp() override {
        ASSERT_EQ(pull(), ExchangeStatus::Ok);
        ASSERT_NE(board.dac_codes(), kZeros);
        ASSERT_EQ(driver.zero_packet().link.kind, LinkKind::Usb);
    }
    ExchangeStatus pull() {
        MotorCommand command;
        command.dac_codes.fill(100);
        BoardReading reading;
        return driver.exchange(command, reading, 0);
    }

    test::FakeUsbfs bus;
    test::FakeUsbBoard& board = bus.plug({});
    UsbBoard driver{BoardKind::Sh4, {test::kSh4, "", std::nullopt}, 200'000'000};
};

TEST_F(PullingUsbBoard, IsSetToZero) {
    EXPECT_EQ(send_zero_packet(driver.zero_packet()), ExchangeStatus::Ok);
    EXPECT_EQ(board.dac_codes(), kZeros);
}

TEST_F(PullingUsbBoard, IsSetToZeroWhileATransferOfItsDriverWaitsForAnAnswer) {
    board.misbehave(Fault::Silent);
    ASSERT_EQ(pull(), ExchangeStatus::Timeout);
    EXPECT_EQ(send_zero_packet(driver.zero_packet()), ExchangeStatus::Ok);
    EXPECT_EQ(board.dac_codes(), kZeros);
}

TEST_F(PullingUsbBoard, IsSetToZeroPastAHaltedEndpoint) {
    board.misbehave(Fault::StallOut);
    EXPECT_EQ(send_zero_packet(driver.zero_packet()), ExchangeStatus::Ok);
    EXPECT_EQ(board.dac_codes(), kZeros);
    EXPECT_EQ(board.halts_cleared(), 1);
}

TEST_F(PullingUsbBoard, IsSetToZeroWhileItWantsToGetRidOfItsAnswersFirst) {
    board.leave_stale_answer(std::vector<std::byte>(kSh4PacketBytes));
    board.leave_stale_answer(std::vector<std::byte>(kSh4PacketBytes));
    board.misbehave(Fault::Full);
    EXPECT_EQ(send_zero_packet(driver.zero_packet()), ExchangeStatus::Ok);
    EXPECT_EQ(board.dac_codes(), kZeros);
}

TEST_F(PullingUsbBoard, LeavesNoAnswerBehindForTheNextSession) {
    EXPECT_EQ(send_zero_packet(driver.zero_packet()), ExchangeStatus::Ok);
    BoardReading reading;
    // An answer to the zeros that was still there would be taken for the answer to this command: stale.
    MotorCommand command;
    command.dac_codes.fill(7);
    EXPECT_EQ(driver.exchange(command, reading, 0), ExchangeStatus::Ok);
}

TEST_F(PullingUsbBoard, ThatDoesNotTakeThePacketOrIsGoneIsNamed) {
    board.misbehave(Fault::Blocked);
    EXPECT_EQ(send_zero_packet(driver.zero_packet()), ExchangeStatus::Timeout);
    board.unplug_after(0);
    EXPECT_EQ(send_zero_packet(driver.zero_packet()), ExchangeStatus::Disconnected);
}

}  // namespace
}  // namespace haptic::device
