// UsbBoard over unmodified libusb: found, opened and driven.
#include "haptic/device/usb_board.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <thread>
#include <utility>

#include "fake_usbfs.hpp"
#include "haptic/device/dac_codes.hpp"
#include "transport/usb_transport.hpp"

namespace haptic::device {
namespace {

using test::kSh4;
using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;
using Fault = test::FakeUsbBoard::Fault;

constexpr std::int64_t kPatient = 1'000'000'000;
constexpr std::int64_t kHasty = 5'000'000;

test::FakeUsbfs::Settings with_rotary(std::uint8_t rotary, const std::string& port, int number) {
    test::FakeUsbfs::Settings settings;
    settings.device.rotary = rotary;
    settings.port = port;
    settings.number = number;
    return settings;
}

TEST(UsbBoard, BringsCountersThatAgreeWithTheGeometry) {
    const DeviceGeometry geometry = spidar_g6_x3r();
    Pose grip;
    grip.position = {0.004, -0.003, 0.002};
    test::FakeUsbfs::Settings settings;
    settings.device.hand = PoseTrack(grip);
    test::FakeUsbfs bus;
    test::FakeUsbBoard& plugged = bus.plug(settings);
    UsbBoard board(BoardKind::Sh4, {.id = kSh4}, kPatient);
    MotorCommand command;
    command.dac_codes.fill(45);
    BoardReading reading;
    ASSERT_EQ(board.exchange(command, reading, 0), ExchangeStatus::Ok);
    EXPECT_EQ(plugged.dac_codes(), command.dac_codes);
    for (std::size_t i = 0; i < kStrings; ++i) {
        const StringFacts& string = geometry.strings[i];
        const double paid_out =
            glm::length(string.motor - grip.position - string.grip) - glm::length(string.motor - string.grip);
        // Sixteen bits, the upper half negative; rounding of half a count.
        const auto counts = static_cast<std::int16_t>(reading.counters[i]);
        EXPECT_NEAR(counts * string.metres_per_count, paid_out, 0.5 * std::abs(string.metres_per_count)) << i;
    }
}

TEST(UsbBoard, SendsWithoutWaitingAndCollectsTheAnswerLater) {
    test::FakeUsbfs bus;
    test::FakeUsbBoard& plugged = bus.plug({});
    UsbBoard board(BoardKind::Sh4, {.id = kSh4}, kPatient);
    MotorCommand command;
    BoardReading reading;
    for (std::int16_t code = 1; code <= 50; ++code) {
        command.dac_codes.fill(code);
        ASSERT_EQ(board.send(command, 0), ExchangeStatus::Ok) << code;
        ASSERT_TRUE(board.answer_due());
        ASSERT_EQ(board.collect(0), ExchangeStatus::Ok) << code;
        ASSERT_EQ(plugged.dac_codes(), command.dac_codes);
        ASSERT_EQ(board.exchange(command, reading, 0), ExchangeStatus::Ok) << code;
    }
    EXPECT_EQ(plugged.early_commands(), 0) << "the transfer for the answer comes first";
}

TEST(UsbBoard, FindsALostAnswerToASentCommandWhenItIsCollected) {
    test::FakeUsbfs bus;
    test::FakeUsbBoard& plugged = bus.plug({});
    UsbBoard board(BoardKind::Sh4, {.id = kSh4}, kHasty);
    MotorCommand command;
    BoardReading reading;
    for (const auto& [fault, expected] :
         {std::pair(Fault::Silent, ExchangeStatus::Timeout), std::pair(Fault::Short, ExchangeStatus::Short),
          std::pair(Fault::Protocol, ExchangeStatus::Failed), std::pair(Fault::StallIn, ExchangeStatus::Stalled),
          std::pair(Fault::Blocked, ExchangeStatus::Timeout)}) {
        plugged.misbehave(fault);
        command.dac_codes.fill(static_cast<std::int16_t>(100 + static_cast<int>(fault)));
        ASSERT_EQ(board.send(command, 0), ExchangeStatus::Ok) << static_cast<int>(fault);
        EXPECT_EQ(board.collect(0), expected) << static_cast<int>(fault);
        // The board recovers with the exchanges that follow.
        plugged.misbehave(Fault::None);
        plugged.release_answers();
        ExchangeStatus status = ExchangeStatus::Failed;
        for (int i = 0; i < 1000 && status != ExchangeStatus::Ok; ++i) {
            command.dac_codes.fill(static_cast<std::int16_t>(200 + i));
            status = board.exchange(command, reading, 0);
            std::this_thread::sleep_for(std::chrono::milliseconds(1));  // a thread clears halts
        }
        ASSERT_EQ(status, ExchangeStatus::Ok) << static_cast<int>(fault);
    }
    bus.remove(plugged);
    const ExchangeStatus sent = board.send(command, 0);
    EXPECT_EQ(sent == ExchangeStatus::Ok ? board.collect(0) : sent, ExchangeStatus::Disconnected);
}

TEST(UsbBoard, OpensTheOnlyOneThatThereIsAndLeavesItsMotorsAtZero) {
    test::FakeUsbfs bus;
    const test::FakeUsbBoard& plugged = bus.plug(with_rotary(5, "1-2.4", 7));
    UsbBoard board(BoardKind::Sh4, {.id = kSh4}, kPatient);
    EXPECT_EQ(board.device().port, "1-2.4");
    EXPECT_GE(plugged.commands(), 1);
    EXPECT_EQ(plugged.dac_codes(), (std::array<std::int16_t, kStrings>{}));
    BoardReading reading;
    ASSERT_EQ(board.exchange({}, reading, 0), ExchangeStatus::Ok);
    EXPECT_EQ(reading.rotary, 5);
}

TEST(UsbBoard, TellsTwoDevicesByTheirRotarySwitches) {
    test::FakeUsbfs bus;
    const test::FakeUsbBoard& third = bus.plug(with_rotary(3, "1-1", 2));
    const test::FakeUsbBoard& eighth = bus.plug(with_rotary(8, "1-2", 3));
    UsbBoard left(BoardKind::Sh4, {.id = kSh4, .rotary = 3}, kPatient);
    UsbBoard right(BoardKind::Sh4, {.id = kSh4, .rotary = 8}, kPatient);
    EXPECT_EQ(left.device().port, "1-1");
    EXPECT_EQ(right.device().port, "1-2");
    BoardReading reading;
    ASSERT_EQ(left.exchange({{1}}, reading, 0), ExchangeStatus::Ok);
    ASSERT_EQ(right.exchange({{2}}, reading, 0), ExchangeStatus::Ok);
    EXPECT_EQ(third.dac_codes()[0], 1);
    EXPECT_EQ(eighth.dac_codes()[0], 2);
}

TEST(UsbBoard, RefusesToGuessAndListsWhatThereIs) {
    test::FakeUsbfs bus;
    bus.plug(with_rotary(3, "1-1", 2));
    bus.plug(with_rotary(8, "1-2", 3));
    bus.plug(with_rotary(8, "1-3", 4)).occupy();
    const auto with = [](const UsbSelection& selection) {
        return [=] { UsbBoard(BoardKind::Sh4, selection, kPatient); };
    };
    const auto lists_all =
        AllOf(HasSubstr("at 1-1 (/dev/bus/usb/001/002): rotary switch 3"), HasSubstr("at 1-2"),
              HasSubstr("rotary switch 8"), HasSubstr("1-3"), HasSubstr("another program"), HasSubstr("device.rotary"));
    EXPECT_THAT(with({.id = kSh4}), ThrowsMessage<UsbError>(AllOf(HasSubstr("more than one"), lists_all)));
    EXPECT_THAT(with({.id = kSh4, .rotary = 4}),
                ThrowsMessage<UsbError>(AllOf(HasSubstr("no usable"), HasSubstr("rotary switch at 4"), lists_all)));
    EXPECT_THAT(with({.id = kSh4, .path = "1-7"}),
                ThrowsMessage<UsbError>(HasSubstr("no USB device 0cec:0205 at 1-7")));
    EXPECT_EQ(UsbBoard(BoardKind::Sh4, {.id = kSh4, .path = "1-2"}, kPatient).device().port, "1-2");
}

TEST(UsbBoard, ResetsADeviceThatDoesNotAnswerAndThenGivesUp) {
    test::FakeUsbfs bus;
    test::FakeUsbBoard& plugged = bus.plug({});
    plugged.misbehave(Fault::Silent);
    EXPECT_THAT([&] { UsbBoard(BoardKind::Sh4, {.id = kSh4}, kHasty); },
                ThrowsMessage<UsbError>(AllOf(HasSubstr("first exchange failed: no reply in time"), HasSubstr("1-1"),
                                              HasSubstr("device.usb_timeout_s"))));
    EXPECT_EQ(plugged.resets(), 1);
}

TEST(UsbBoard, GetsOverAStallOfAnEarlierSession) {
    for (const Fault stall : {Fault::StallIn, Fault::StallOut}) {
        test::FakeUsbfs bus;
        test::FakeUsbBoard& plugged = bus.plug({});
        plugged.misbehave(stall);
        UsbBoard board(BoardKind::Sh4, {.id = kSh4}, kPatient);
        BoardReading reading;
        EXPECT_EQ(board.exchange({}, reading, 0), ExchangeStatus::Ok);
        EXPECT_EQ(plugged.halts_cleared(), 1);
        EXPECT_EQ(plugged.resets(), 0);
    }
}

TEST(UsbBoard, IsFoundAgainAtItsPortAfterItWasUnplugged) {
    test::FakeUsbfs bus;
    test::FakeUsbBoard& plugged = bus.plug({});
    UsbBoard board(BoardKind::Sh4, {.id = kSh4}, kPatient);
    BoardReading reading;
    bus.remove(plugged);
    EXPECT_EQ(board.exchange({}, reading, 0), ExchangeStatus::Disconnected);
    EXPECT_TRUE(board.gone());
    EXPECT_THROW(board.reopen(), UsbError);
    EXPECT_EQ(board.exchange({}, reading, 0), ExchangeStatus::Disconnected);
    const test::FakeUsbBoard& again = bus.plug({.number = 3});
    board.reopen();
    EXPECT_EQ(board.device().node, "/dev/bus/usb/001/003");
    ASSERT_EQ(board.exchange({{7}}, reading, 0), ExchangeStatus::Ok);
    EXPECT_EQ(again.dac_codes()[0], 7);
    board.zero_motors(0);
    EXPECT_EQ(again.dac_codes()[0], 0);
}

}  // namespace
}  // namespace haptic::device
