// UsbTransport over unmodified libusb and umockdev's usbfs, with the project's emulated firmware as board.
#include "transport/usb_transport.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <thread>
#include <vector>

#include "codecs/sh4_codec.hpp"
#include "fake_usbfs.hpp"

namespace haptic::device {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;
using Fault = test::FakeUsbBoard::Fault;

constexpr std::array<std::uint16_t, kStrings> kDacCodes = {45, 46, 47, 48, 49, 50, 51, 4095};

Sh4Packet packet_of(const std::array<std::uint16_t, kStrings>& dac_codes) {
    Sh4Packet packet;
    encode(Sh4Command{dac_codes}, packet);
    return packet;
}

class UsbTransportTest : public testing::Test {
  protected:
    /// One command and its reply.
    ExchangeStatus exchange(const std::array<std::uint16_t, kStrings>& dac_codes = kDacCodes) {
        const Sh4Packet out = packet_of(dac_codes);
        PacketExchange packets{{std::span<const std::byte>(out)}, std::span<std::byte>(in)};
        const ExchangeStatus status = transport.exchange(packets, 0);
        received = packets.received;
        return status;
    }
    ExchangeStatus read_once() {
        PacketExchange packets{{}, std::span<std::byte>(in)};
        return transport.exchange(packets, 0);
    }
    Sh4Reply reply() const {
        Sh4Reply decoded;
        EXPECT_EQ(decode(std::span<const std::byte>(in), decoded), PacketDefect::None);
        return decoded;
    }
    /// Repeats exchanges until one ends with another status, for at most 5 s.
    ExchangeStatus exchange_until(ExchangeStatus wanted) {
        ExchangeStatus status = exchange();
        for (int i = 0; i < 5000 && status != wanted; ++i) {
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
            status = exchange();
        }
        return status;
    }

    test::FakeUsbfs bus;
    test::FakeUsbBoard& board = bus.plug({});
    // One second: enough for a loaded machine, and reached only without a reply.
    UsbTransport transport{{.timeout_ns = 1'000'000'000}};
    UsbTransport hasty{{.timeout_ns = 2'000'000}};
    Sh4Packet in{};
    std::size_t received = 0;
    const std::string node = "/dev/bus/usb/001/002";
};

TEST_F(UsbTransportTest, CarriesACommandAndItsAnswer) {
    transport.open(node);
    ASSERT_EQ(exchange(), ExchangeStatus::Ok);
    EXPECT_EQ(received, 512U);
    EXPECT_EQ(reply().dac_codes, kDacCodes);
    EXPECT_EQ(board.dac_codes()[7], 4095);
    EXPECT_EQ(board.commands(), 1);
}

TEST_F(UsbTransportTest, AwaitsTheAnswerBeforeItSendsTheCommand) {
    transport.open(node);
    for (int i = 0; i < 10; ++i) {
        ASSERT_EQ(exchange(), ExchangeStatus::Ok);
    }
    EXPECT_EQ(board.commands(), 10);
    EXPECT_EQ(board.early_commands(), 0);
}

TEST_F(UsbTransportTest, SendsTwoPacketsInTheirOrderInOneExchange) {
    transport.open(node);
    const Sh4Packet first = packet_of({1, 1, 1, 1, 1, 1, 1, 1});
    const Sh4Packet second = packet_of(kDacCodes);
    PacketExchange packets{{std::span<const std::byte>(first), std::span<const std::byte>(second)},
                           std::span<std::byte>(in)};
    ASSERT_EQ(transport.exchange(packets, 0), ExchangeStatus::Ok);
    EXPECT_EQ(board.commands(), 2);
    EXPECT_EQ(board.dac_codes()[7], 4095);
}

TEST_F(UsbTransportTest, SendsWithoutAwaitingAnythingWhereNoAnswerIsAskedFor) {
    transport.open(node);
    const Sh4Packet out = packet_of(kDacCodes);
    PacketExchange packets{{std::span<const std::byte>(out)}, {}};
    ASSERT_EQ(transport.exchange(packets, 0), ExchangeStatus::Ok);
    EXPECT_EQ(packets.received, 0U);
    EXPECT_EQ(board.dac_codes()[7], 4095);
    ASSERT_EQ(read_once(), ExchangeStatus::Ok) << "the answer waits to be read";
    EXPECT_EQ(reply().dac_codes, kDacCodes);
}

TEST_F(UsbTransportTest, ThrowsAwayWhatAnEarlierSessionHasLeft) {
    board.leave_stale_answer(std::vector<std::byte>(512, std::byte{0xAA}));
    board.leave_stale_answer(std::vector<std::byte>(512, std::byte{0xBB}));
    transport.open(node);
    ASSERT_EQ(exchange(), ExchangeStatus::Ok);
    EXPECT_EQ(reply().dac_codes, kDacCodes);
}

TEST_F(UsbTransportTest, EndsWithATimeoutWhereNoAnswerComes) {
    hasty.open(node);
    board.misbehave(Fault::Silent);
    const Sh4Packet out = packet_of(kDacCodes);
    const Sh4Packet before = in;
    for (int i = 0; i < 3; ++i) {
        PacketExchange packets{{std::span<const std::byte>(out)}, std::span<std::byte>(in)};
        EXPECT_EQ(hasty.exchange(packets, 0), ExchangeStatus::Timeout);
        EXPECT_EQ(packets.received, 0U);
    }
    EXPECT_EQ(in, before);
    EXPECT_EQ(board.commands(), 3) << "each command is sent all the same: zeros among them";
}

TEST_F(UsbTransportTest, ThrowsALateAnswerAway) {
    hasty.open(node);
    board.misbehave(Fault::Silent);
    const Sh4Packet late = packet_of({9, 9, 9, 9, 9, 9, 9, 9});
    PacketExchange packets{{std::span<const std::byte>(late)}, std::span<std::byte>(in)};
    ASSERT_EQ(hasty.exchange(packets, 0), ExchangeStatus::Timeout);
    board.release_answers();
    const Sh4Packet out = packet_of(kDacCodes);
    // On a loaded machine the first exchange may exceed 2 ms, but not all of the next ones.
    ExchangeStatus status = ExchangeStatus::Timeout;
    for (int i = 0; i < 100 && status != ExchangeStatus::Ok; ++i) {
        packets = {{std::span<const std::byte>(out)}, std::span<std::byte>(in)};
        status = hasty.exchange(packets, 0);
    }
    ASSERT_EQ(status, ExchangeStatus::Ok);
    EXPECT_EQ(reply().dac_codes, kDacCodes);
}

TEST_F(UsbTransportTest, LetsNoCommandOvertakeOneThatTheBoardHasNotTakenYet) {
    hasty.open(node);
    board.misbehave(Fault::Blocked);
    const Sh4Packet first = packet_of({9, 9, 9, 9, 9, 9, 9, 9});
    for (int i = 0; i < 3; ++i) {
        PacketExchange packets{{std::span<const std::byte>(first)}, std::span<std::byte>(in)};
        EXPECT_EQ(hasty.exchange(packets, 0), ExchangeStatus::Timeout);
    }
    EXPECT_EQ(board.commands(), 0);
    board.release_answers();
    EXPECT_EQ(board.commands(), 1) << "one was submitted, and the others waited for it";
}

TEST_F(UsbTransportTest, GivesAShortAnswerWithItsLength) {
    transport.open(node);
    board.misbehave(Fault::Short);
    EXPECT_EQ(exchange(), ExchangeStatus::Ok);
    EXPECT_EQ(received, 100U);
}

TEST_F(UsbTransportTest, RefusesAnAnswerThatIsLongerThanTheRoomForIt) {
    transport.open(node);
    const Sh4Packet out = packet_of(kDacCodes);
    std::array<std::byte, 32> room{};
    PacketExchange packets{{std::span<const std::byte>(out)}, std::span<std::byte>(room)};
    EXPECT_EQ(transport.exchange(packets, 0), ExchangeStatus::Short);
    EXPECT_EQ(room, (std::array<std::byte, 32>{}));
    board.misbehave(Fault::Overflow);
    EXPECT_EQ(exchange(), ExchangeStatus::Short);
}

TEST_F(UsbTransportTest, ClearsAStallOfEitherEndpointAndGoesOn) {
    transport.open(node);
    int cleared = 0;
    for (const Fault stall : {Fault::StallIn, Fault::StallOut}) {
        board.misbehave(stall);
        EXPECT_EQ(exchange(), ExchangeStatus::Stalled);
        EXPECT_EQ(exchange_until(ExchangeStatus::Ok), ExchangeStatus::Ok);
        EXPECT_EQ(reply().dac_codes, kDacCodes);
        EXPECT_EQ(board.halts_cleared(), ++cleared);
    }
}

TEST_F(UsbTransportTest, NamesWhatTheBusDidNotCarry) {
    transport.open(node);
    board.misbehave(Fault::Protocol);
    EXPECT_EQ(exchange(), ExchangeStatus::Failed);
    board.misbehave(Fault::None);
    EXPECT_EQ(exchange(), ExchangeStatus::Ok);
}

TEST_F(UsbTransportTest, IsDisconnectedFromTheExchangeOnInWhichTheCableIsPulled) {
    transport.open(node);
    EXPECT_FALSE(transport.gone());
    board.unplug_after(2);
    EXPECT_EQ(exchange(), ExchangeStatus::Ok);
    EXPECT_EQ(exchange(), ExchangeStatus::Disconnected) << "the command was taken, its answer never came";
    EXPECT_EQ(exchange(), ExchangeStatus::Disconnected);
    EXPECT_EQ(board.commands(), 2);
    EXPECT_TRUE(transport.gone());
    EXPECT_THROW(transport.drain(), UsbError);
    transport.send_last(packet_of({}), 0);  // has no effect and returns
}

TEST_F(UsbTransportTest, OpensTheDeviceThatHasBeenPluggedInAgain) {
    transport.open(node);
    ASSERT_EQ(exchange(), ExchangeStatus::Ok);
    bus.remove(board);
    EXPECT_EQ(exchange(), ExchangeStatus::Disconnected);
    EXPECT_THROW(transport.open(node), UsbError);
    EXPECT_EQ(exchange(), ExchangeStatus::Disconnected) << "closed";
    test::FakeUsbBoard& again = bus.plug({.number = 3});
    transport.open("/dev/bus/usb/001/003");
    EXPECT_EQ(exchange(), ExchangeStatus::Ok);
    EXPECT_EQ(again.dac_codes()[7], 4095);
}

TEST_F(UsbTransportTest, SendsTheLastPacketWithoutLibusb) {
    transport.open(node);
    ASSERT_EQ(exchange(), ExchangeStatus::Ok);
    transport.send_last(packet_of({}), 0);
    EXPECT_EQ(board.dac_codes(), (std::array<std::int16_t, kStrings>{}));
}

TEST_F(UsbTransportTest, SendsTheLastPacketWhileAnotherThreadIsWithinAnExchange) {
    transport.open(node);
    board.misbehave(Fault::Silent);
    std::thread exchanging([this] { exchange(); });
    while (board.commands() < 1) {
        std::this_thread::yield();
    }
    transport.send_last(packet_of({}), 0);
    EXPECT_EQ(board.dac_codes(), (std::array<std::int16_t, kStrings>{}));
    board.release_answers();
    exchanging.join();
}

TEST_F(UsbTransportTest, ClearsAStallForTheLastPacket) {
    transport.open(node);
    ASSERT_EQ(exchange(), ExchangeStatus::Ok);
    board.misbehave(Fault::StallOut);
    transport.send_last(packet_of({}), 0);
    EXPECT_EQ(board.dac_codes(), (std::array<std::int16_t, kStrings>{}));
}

TEST_F(UsbTransportTest, IsDisconnectedWhileItIsClosed) {
    EXPECT_EQ(exchange(), ExchangeStatus::Disconnected);
    EXPECT_TRUE(transport.gone());
    transport.send_last(packet_of({}), 0);
    EXPECT_THROW(transport.drain(), UsbError);
    EXPECT_FALSE(transport.reset());
}

TEST_F(UsbTransportTest, CanBeResetAndGoesOn) {
    transport.open(node);
    EXPECT_TRUE(transport.reset());
    EXPECT_EQ(board.resets(), 1);
    EXPECT_EQ(exchange(), ExchangeStatus::Ok);
}

TEST_F(UsbTransportTest, RefusesADeviceWithoutTheBoardsEndpointsAndListsThoseThatItHas) {
    bus.plug({.port = "1-2", .number = 3, .endpoint_in = 0x82});
    EXPECT_THAT([&] { transport.open("/dev/bus/usb/001/003"); },
                ThrowsMessage<UsbError>(AllOf(HasSubstr("/dev/bus/usb/001/003"), HasSubstr("0x86"),
                                              HasSubstr("0x02 (bulk), 0x82 (bulk)"))));
    bus.plug({.port = "1-3", .number = 4, .endpoint_attributes = 0x03});
    EXPECT_THAT([&] { transport.open("/dev/bus/usb/001/004"); }, ThrowsMessage<UsbError>(HasSubstr("0x86 (not bulk)")));
    EXPECT_EQ(exchange(), ExchangeStatus::Disconnected);
}

TEST_F(UsbTransportTest, SaysThatAnotherProgramHasTheDevice) {
    board.occupy();
    EXPECT_THAT([&] { transport.open(node); }, ThrowsMessage<UsbError>(HasSubstr("another program")));
}

TEST_F(UsbTransportTest, SaysThatThereIsNoSuchNode) {
    EXPECT_THAT([&] { transport.open("/dev/bus/usb/001/099"); },
                ThrowsMessage<UsbError>(AllOf(HasSubstr("/dev/bus/usb/001/099"), HasSubstr("No such file"))));
}

TEST_F(UsbTransportTest, NeedsATimeout) {
    EXPECT_THROW(UsbTransport({.timeout_ns = 0}), std::invalid_argument);
}

}  // namespace
}  // namespace haptic::device
