// Zeros over a serial line, from the descriptor that another process has left in any state.
#include "haptic/device/zero_packet.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <string>
#include <vector>

#include "boards/uart_board.hpp"
#include "emulated/emulated_transport.hpp"
#include "emulated/uart_firmware.hpp"
#include "haptic/clock.hpp"
#include "haptic/device/device_geometry_file.hpp"
#include "haptic/device/tty_board.hpp"
#include "served/tty_server.hpp"

namespace haptic::device {
namespace {

constexpr std::array<std::int16_t, kStrings> kZeros{};

/// Boards on a served line that pull, as a process has left them.
class PullingLine : public testing::TestWithParam<const char*> {
  protected:
    void SetUp() override {
        // The packet is that of a driver that has found the boards.
        EmulatedTransport transport(firmware);
        UartBoard board(transport);
        board.start();
        MotorCommand command;
        command.dac_codes.fill(100);
        BoardReading reading;
        ASSERT_EQ(board.exchange(command, reading, 0), ExchangeStatus::Ok);
        zero = board.zero_packet();
        ASSERT_EQ(zero.link.kind, LinkKind::None) << "an emulated transport has no descriptor";
        zero.link = {LinkKind::Serial, open(server.path().c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC)};
        ASSERT_GE(zero.link.descriptor, 0);
        ASSERT_NE(device.dac_codes(), kZeros);
    }
    void TearDown() override { close(zero.link.descriptor); }
    void write_raw(const std::vector<unsigned char>& bytes) const {
        ASSERT_EQ(write(zero.link.descriptor, bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
    }
    void serve() { server.step(monotonic_now_ns()); }

    EmulatedDevice device{{.geometry = built_in_geometry(GetParam())}};
    UartFirmware firmware{device};
    TtyServer server{firmware, {}};
    ZeroPacket zero;
};

INSTANTIATE_TEST_SUITE_P(Boards, PullingLine, testing::Values("SpidarG6X4", "SpidarG6X5R"),
                         [](const auto& param) { return std::string(param.param); });

TEST_P(PullingLine, IsSetToZero) {
    EXPECT_EQ(send_zero_packet(zero), ExchangeStatus::Ok);
    serve();
    EXPECT_EQ(device.dac_codes(), kZeros);
}

TEST_P(PullingLine, IsSetToZeroAfterACommandThatWasSentInPart) {
    // Each length that a killed process can leave, taken by the boards before the zeros come: header 0x30 is command 6
    // to board 0.
    const std::size_t longest = device.geometry().uart_boards.front() == 8 ? 17 : 9;
    for (std::size_t length = 1; length < longest; ++length) {
        std::vector<unsigned char> part(length, 0x11);
        part[0] = 0x30;
        write_raw(part);
        serve();
        ASSERT_EQ(send_zero_packet(zero), ExchangeStatus::Ok);
        serve();
        ASSERT_EQ(device.dac_codes(), kZeros) << length << " bytes of a command";
    }
}

TEST_P(PullingLine, IsSetToZeroInsteadOfTheCommandsThatStillWait) {
    // More than the boards have read: they would follow one another, and the zeros come last.
    for (int i = 0; i < 20; ++i) {
        write_raw({0x30, 1, 1, 1, 1, 1, 1, 1, 1});
    }
    EXPECT_EQ(send_zero_packet(zero), ExchangeStatus::Ok);
    serve();
    EXPECT_EQ(device.dac_codes(), kZeros);
}

TEST_P(PullingLine, IsSetToZeroWhileNobodyReadsTheAnswers) {
    // The boards' answers have filled the terminal, which drops what does not fit.
    for (int i = 0; i < 2000; ++i) {
        write_raw(std::vector<unsigned char>(64, 0));
        write_raw({0x30, 1, 1, 1, 1, 1, 1, 1, 1});
        serve();
    }
    EXPECT_EQ(send_zero_packet(zero), ExchangeStatus::Ok);
    serve();
    EXPECT_EQ(device.dac_codes(), kZeros);
}

TEST(ZeroPacket, WithoutALinkOrAPacketIsAFailureAndNotSilence) {
    ZeroPacket none;
    EXPECT_EQ(send_zero_packet(none), ExchangeStatus::Failed);
    none.link = {LinkKind::Serial, -1};
    EXPECT_EQ(send_zero_packet(none), ExchangeStatus::Failed);
    none.set_packet(std::vector<std::byte>(ZeroPacket::kMaxBytes + 1));
    EXPECT_EQ(none.size, 0u) << "a packet that was cut off would be another one";
}

}  // namespace
}  // namespace haptic::device
