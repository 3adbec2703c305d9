// Counts the allocations of libusb in an exchange, the figure in firmware-host's documentation.
#include <gtest/gtest.h>

#include <array>

#include "allocation_guard.hpp"
#include "codecs/sh4_codec.hpp"
#include "fake_usbfs.hpp"
#include "transport/usb_transport.hpp"

namespace haptic::device {
namespace {

// libusb 1.0.26 allocates a transfer's URBs on submission and frees them when it ends.
constexpr std::size_t kCallsForATransfer = 2;

std::size_t calls_in(UsbTransport& transport, PacketExchange packets) {
    const test::AllocationGuard guard;
    const ExchangeStatus status = transport.exchange(packets, 0);
    const std::size_t calls = guard.calls();
    EXPECT_EQ(status, ExchangeStatus::Ok);
    return calls;
}

TEST(UsbAllocations, AreOneForEachTransferAndItsRelease) {
    test::FakeUsbfs bus;
    bus.plug({});
    UsbTransport transport({.timeout_ns = 1'000'000'000});
    transport.open("/dev/bus/usb/001/002");
    Sh4Packet out;
    encode(Sh4Command{}, out);
    Sh4Packet in;
    for (int i = 0; i < 100; ++i) {
        EXPECT_EQ(calls_in(transport, {{std::span<const std::byte>(out)}, std::span<std::byte>(in)}),
                  2 * kCallsForATransfer);
    }
}

TEST(UsbAllocations, AreNoneWhereThereIsNoDevice) {
    test::FakeUsbfs bus;
    test::FakeUsbBoard& board = bus.plug({});
    UsbTransport transport({.timeout_ns = 1'000'000'000});
    transport.open("/dev/bus/usb/001/002");
    board.unplug_after(0);
    Sh4Packet out;
    encode(Sh4Command{}, out);
    Sh4Packet in;
    PacketExchange packets{{std::span<const std::byte>(out)}, std::span<std::byte>(in)};
    ASSERT_EQ(transport.exchange(packets, 0), ExchangeStatus::Disconnected);
    const test::AllocationGuard guard;
    EXPECT_EQ(transport.exchange(packets, 0), ExchangeStatus::Disconnected);
    transport.send_last(out, 0);
    EXPECT_EQ(guard.calls(), 0U);
}

}  // namespace
}  // namespace haptic::device
