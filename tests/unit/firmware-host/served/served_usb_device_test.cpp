// ServedUsbDevice: what depends on the speed. The rest is covered through each protocol.
#include "served/served_usb_device.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <optional>

namespace haptic::device {
namespace {

using Bytes = std::vector<std::byte>;

/// Counts pieces; replies as configured.
class PieceFirmware final : public Firmware {
  public:
    void receive(std::span<const std::byte> out, std::int64_t /*now_ns*/) HAPTIC_RT override {
        HAPTIC_RT_EXCEPTION_BEGIN("in a test, never in a tick")
        received.push_back(out.size());
        HAPTIC_RT_EXCEPTION_END
    }
    std::size_t reply(std::span<std::byte> in, std::int64_t /*now_ns*/) HAPTIC_RT override {
        if (replies.empty()) {
            return 0;
        }
        HAPTIC_RT_EXCEPTION_BEGIN("in a test, never in a tick")
        const std::size_t count = std::min(in.size(), replies.front());
        replies.pop_front();
        return count;
        HAPTIC_RT_EXCEPTION_END
    }

    std::vector<std::size_t> received;
    std::deque<std::size_t> replies;
};

class ServedUsbDeviceTest : public testing::TestWithParam<UsbSpeed> {
  protected:
    /// Length with which an IN transfer of 1024 bytes has ended; empty while it is pending.
    std::optional<std::size_t> receive() {
        std::optional<std::size_t> length;
        const auto done = [&](TransferStatus status, std::span<const std::byte> data) {
            EXPECT_EQ(status, TransferStatus::Ok);
            length = data.size();
        };
        EXPECT_TRUE(device.receive(kEndpointIn, {.id = 1, .length = 1024, .done = done}, 0));
        device.cancel(1);
        return length;
    }

    PieceFirmware firmware;
    ServedUsbDevice device{BoardKind::Sh4, firmware, GetParam()};
};

INSTANTIATE_TEST_SUITE_P(Speeds, ServedUsbDeviceTest, testing::Values(UsbSpeed::Full, UsbSpeed::High));

TEST_P(ServedUsbDeviceTest, AReplyOfWholePacketsDoesNotEndATransferAndAShorterPacketDoes) {
    firmware.replies = {512};
    EXPECT_EQ(receive(), std::nullopt);
    firmware.replies = {512, 512};
    EXPECT_EQ(receive(), 1024u);
    firmware.replies = {512, 65};
    EXPECT_EQ(receive(), 577u);
    // 64 bytes are a whole packet at full speed, and a short one at high speed.
    firmware.replies = {64};
    EXPECT_EQ(receive(), GetParam() == UsbSpeed::Full ? std::nullopt : std::optional<std::size_t>(64));
}

TEST_P(ServedUsbDeviceTest, TheFirmwareReceivesPiecesOf512BytesAtEachSpeed) {
    EXPECT_EQ(device.send(kEndpointOut, Bytes(1100), false, 0), TransferStatus::Ok);
    EXPECT_EQ(firmware.received, (std::vector<std::size_t>{512, 512, 76}));
}

}  // namespace
}  // namespace haptic::device
