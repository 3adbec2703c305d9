#include "transport/serial_transport.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/ioctl.h>
#include <termios.h>

#include "boards/uart_board.hpp"
#include "bytes.hpp"
#include "emulated/uart_firmware.hpp"
#include "haptic/clock.hpp"
#include "haptic/device/emulated_device.hpp"
#include "pty.hpp"

namespace haptic::device {
namespace {

using test::Bytes;
using test::bytes;
using test::FarEnd;
using test::Pty;
using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

// ns; long enough for a busy machine. Only exchanges without a reply take this long.
constexpr std::int64_t kPatient = 2'000'000'000;
constexpr std::int64_t kBrief = 5'000'000;

ExchangeStatus exchange(SerialTransport& transport, const Bytes& out, Bytes& in, std::size_t room) {
    in.assign(room, std::byte{0});
    PacketExchange packets{{std::span<const std::byte>(out)}, std::span<std::byte>(in)};
    const ExchangeStatus status = transport.exchange(packets, 0);
    in.resize(packets.received);
    return status;
}

TEST(SerialTransport, SetsTheLineToRawBytesAtTheSpeedOfTheBoards) {
    const Pty pty;
    const SerialTransport transport(pty.path(), {});
    const int line = open(pty.path().c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC);
    termios settings{};
    const int asked = tcgetattr(line, &settings);
    close(line);
    ASSERT_EQ(asked, 0);
    EXPECT_EQ(cfgetospeed(&settings), B2000000);
    EXPECT_EQ(cfgetispeed(&settings), B2000000);
    EXPECT_EQ(settings.c_cflag & CSIZE, CS8);
    EXPECT_EQ(settings.c_cflag & (PARENB | CSTOPB | CRTSCTS), 0U);
    EXPECT_EQ(settings.c_lflag & (ECHO | ICANON | ISIG | IEXTEN), 0U);
    EXPECT_EQ(settings.c_iflag & (IXON | IXOFF | ICRNL | INLCR | ISTRIP | PARMRK), 0U);
    EXPECT_EQ(settings.c_oflag & OPOST, 0U);
}

TEST(SerialTransport, CarriesEveryByteUnchangedBothWays) {
    const Pty pty;
    SerialTransport transport(pty.path(), {.timeout_ns = kPatient});
    Bytes every;
    for (int k = 0; k < 256; ++k) {
        every.push_back(static_cast<std::byte>(k));
    }
    const FarEnd echo(pty, [](const Bytes& in) { return in; });
    Bytes in;
    ASSERT_EQ(exchange(transport, every, in, 256), ExchangeStatus::Ok);
    EXPECT_EQ(in, every);
}

TEST(SerialTransport, WaitsForAnAnswerThatComesInPieces) {
    const Pty pty;
    SerialTransport transport(pty.path(), {.timeout_ns = kPatient});
    const FarEnd slow(pty, [&](const Bytes&) {
        for (const int byte : {1, 2, 3}) {
            pty.write(bytes({byte}));
            (void)pty.wait(2);
        }
        return bytes({4});
    });
    Bytes in;
    ASSERT_EQ(exchange(transport, bytes({9}), in, 4), ExchangeStatus::Ok);
    EXPECT_EQ(in, bytes({1, 2, 3, 4}));
}

TEST(SerialTransport, ThrowsAwayWhatStoodInTheInputBeforeTheCommand) {
    const Pty pty;
    SerialTransport transport(pty.path(), {.timeout_ns = kPatient});
    pty.write(Bytes(600, std::byte{0xEE}));
    Bytes in;
    const FarEnd far(pty, [](const Bytes&) { return bytes({1, 2}); });
    ASSERT_EQ(exchange(transport, bytes({9}), in, 2), ExchangeStatus::Ok);
    EXPECT_EQ(in, bytes({1, 2}));
}

TEST(SerialTransport, KeepsTheInputWhereNothingIsSent) {
    const Pty pty;
    SerialTransport transport(pty.path(), {.timeout_ns = kPatient});
    pty.write(bytes({1, 2, 3}));
    Bytes in;
    ASSERT_EQ(exchange(transport, {}, in, 3), ExchangeStatus::Ok);
    EXPECT_EQ(in, bytes({1, 2, 3}));
}

TEST(SerialTransport, EndsWithinItsTimeWhetherNothingComesOrTooLittle) {
    const Pty pty;
    SerialTransport transport(pty.path(), {.timeout_ns = kBrief});
    Bytes in;
    EXPECT_EQ(exchange(transport, bytes({9}), in, 4), ExchangeStatus::Timeout);
    EXPECT_EQ(in, Bytes{});
    pty.write(bytes({1, 2}));
    EXPECT_EQ(exchange(transport, {}, in, 4), ExchangeStatus::Ok);
    EXPECT_EQ(in, bytes({1, 2}));
}

TEST(SerialTransport, EndsWithinItsTimeWhereTheLineTakesNothing) {
    const Pty pty;  // nobody reads its other end, which buffers a few kilobytes
    SerialTransport transport(pty.path(), {.timeout_ns = kBrief});
    const Bytes much(1 << 20, std::byte{0x55});
    Bytes in;
    EXPECT_EQ(exchange(transport, much, in, 1), ExchangeStatus::Timeout);
    transport.send_last(bytes({1}), 0);  // does not block either
}

TEST(SerialTransport, SaysThatTheLineIsGone) {
    Pty pty;
    SerialTransport transport(pty.path(), {.timeout_ns = kPatient});
    pty.hang_up();
    Bytes in;
    EXPECT_EQ(exchange(transport, bytes({9}), in, 4), ExchangeStatus::Disconnected);
    EXPECT_EQ(exchange(transport, {}, in, 4), ExchangeStatus::Disconnected);
    transport.send_last(bytes({1}), 0);
    EXPECT_THAT([&] { transport.reopen(); }, ThrowsMessage<BoardError>(HasSubstr(pty.path())));
    EXPECT_EQ(exchange(transport, bytes({9}), in, 4), ExchangeStatus::Disconnected);
}

TEST(SerialTransport, GoesOnWhereItWasOpenedAnew) {
    const Pty pty;
    SerialTransport transport(pty.path(), {.timeout_ns = kPatient});
    transport.reopen();
    const FarEnd echo(pty, [](const Bytes& in) { return in; });
    Bytes in;
    ASSERT_EQ(exchange(transport, bytes({7}), in, 1), ExchangeStatus::Ok);
    EXPECT_EQ(in, bytes({7}));
}

TEST(SerialTransport, SendsTheLastPacketWithoutWaiting) {
    const Pty pty;
    SerialTransport transport(pty.path(), {});
    transport.send_last(bytes({1, 2, 3}), 0);
    EXPECT_EQ(pty.read(3), bytes({1, 2, 3}));
}

TEST(SerialTransport, DrainsUntilTheLineIsSilent) {
    const Pty pty;
    SerialTransport transport(pty.path(), {.timeout_ns = kBrief});
    pty.write(Bytes(3000, std::byte{0xEE}));
    transport.drain();
    Bytes in;
    EXPECT_EQ(exchange(transport, {}, in, 1), ExchangeStatus::Timeout);
}

TEST(SerialTransport, IsRefusedALineThatAnotherOneDrives) {
    const Pty pty;
    {
        const SerialTransport first(pty.path(), {});
        EXPECT_THAT([&] { SerialTransport(pty.path(), {}); }, ThrowsMessage<BoardError>(HasSubstr("another process")));
    }
    EXPECT_NO_THROW(SerialTransport(pty.path(), {}));
}

TEST(SerialTransport, SaysWhatIsNoSerialLineAndWhatToDo) {
    EXPECT_THAT([] { SerialTransport("/dev/does-not-exist", {}); },
                ThrowsMessage<BoardError>(AllOf(HasSubstr("/dev/does-not-exist"), HasSubstr("/dev/serial/by-id"))));
    EXPECT_THAT([] { SerialTransport("/dev/null", {}); }, ThrowsMessage<BoardError>(HasSubstr("not a serial line")));
    const Pty pty;
    EXPECT_THAT([&] { SerialTransport(pty.path(), {.baud = 12345}); },
                ThrowsMessage<BoardError>(AllOf(HasSubstr("12345"), HasSubstr("2000000"))));
}

TEST(SerialTransport, IsALineOnWhichBoardsAreFound) {
    DeviceGeometry geometry = spidar_g6_x3r();
    geometry.board = BoardKind::Uart;
    geometry.uart_boards = {4, 4};
    EmulatedDevice device({.geometry = geometry, .power_up = {1, 2, 3, 4, 5, 6, 7, 65535}});
    UartFirmware firmware(device);
    const Pty pty;
    const FarEnd boards(pty, [&](const Bytes& in) {
        firmware.receive(in, 0);
        Bytes out(512);
        out.resize(firmware.reply(out, 0));
        return out;
    });
    // Six ids do not reply, each for five times this.
    SerialTransport transport(pty.path(), {.timeout_ns = 20'000'000});
    UartBoard board(transport);
    board.start();
    EXPECT_EQ(board.found(), "id 0: model 5, 4 motors; id 1: model 5, 4 motors");
}

}  // namespace
}  // namespace haptic::device
