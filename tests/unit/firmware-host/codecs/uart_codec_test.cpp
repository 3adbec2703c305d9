#include "codecs/uart_codec.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "bytes.hpp"

namespace haptic::device {
namespace {

using test::Bytes;
using test::bytes;

constexpr UartCurrents kCurrents = {0x0102, -2, 0x0304, -4095, 4095, 0, -1, 1};

TEST(UartCodec, CurrentsOfABoardOfFourAreThePublishedPacket) {
    Bytes out(9, std::byte{0xAA});
    ASSERT_EQ(encode_currents(3, kUartB3M, kCurrents, out), PacketDefect::None);
    // Header: id 3 | current 6 << 3.
    EXPECT_EQ(out, bytes({0x33, 0x02, 0x01, 0xFE, 0xFF, 0x04, 0x03, 0x01, 0xF0}));
}

TEST(UartCodec, CurrentsOfABoardOfEightAreThePublishedPacket) {
    Bytes out(17, std::byte{0xAA});
    ASSERT_EQ(encode_currents(0, kUartB5M, kCurrents, out), PacketDefect::None);
    EXPECT_EQ(out, bytes({0x30, 0x02, 0x01, 0xFE, 0xFF, 0x04, 0x03, 0x01, 0xF0, 0xFF, 0x0F, 0x00, 0x00, 0xFF, 0xFF,
                          0x01, 0x00}));
}

TEST(UartCodec, HostNeverSendsMoreThanTwelveBitsOfEitherSign) {
    Bytes out(9);
    ASSERT_EQ(encode_currents(1, kUartB3M, {4096, -4096, 32767, -32768}, out), PacketDefect::None);
    EXPECT_EQ(out, bytes({0x31, 0xFF, 0x0F, 0x01, 0xF0, 0xFF, 0x0F, 0x01, 0xF0}));
}

TEST(UartCodec, LengthsOfTheKnownBoardsAreThePublishedOnes) {
    // none, info, lengths, all, sensor, direct, current, interpolate, force control, set, reset, get.
    EXPECT_EQ(uart_lengths(kUartB3M), (UartLengths{1, 1, 13, 21, 1, 17, 9, 12, 12, 18, 3, 2}));
    EXPECT_EQ(uart_lengths(kUartB5M), (UartLengths{1, 1, 13, 85, 1, 33, 17, 20, 84, 34, 3, 2}));
    Bytes out(13, std::byte{0xAA});
    ASSERT_EQ(encode_lengths(5, uart_lengths(kUartB3M), out), PacketDefect::None);
    EXPECT_EQ(out, bytes({0x15, 1, 1, 13, 21, 1, 17, 9, 12, 12, 18, 3, 2}));
    UartLengths back{};
    ASSERT_EQ(decode_lengths(out, 5, back), PacketDefect::None);
    EXPECT_EQ(back, uart_lengths(kUartB3M));
}

TEST(UartCodec, PacketsOfTheKnownBoardsAreAsLongAsPublished) {
    EXPECT_EQ(uart_current_command_bytes(kUartB3M), 9U);
    EXPECT_EQ(uart_current_reply_bytes(kUartB3M), 17U);
    EXPECT_EQ(uart_current_command_bytes(kUartB5M), 17U);
    EXPECT_EQ(uart_current_reply_bytes(kUartB5M), 41U);
}

TEST(UartCodec, GoldenBoardInfo) {
    Bytes in(7);
    ASSERT_EQ(encode_info(2, kUartB5M, in), PacketDefect::None);
    EXPECT_EQ(in, bytes({0x0A, 7, 12, 8, 8, 4, 0}));
    UartBoardInfo info;
    ASSERT_EQ(decode_info(in, 2, info), PacketDefect::None);
    EXPECT_EQ(info, kUartB5M);
}

TEST(UartCodec, GoldenReplies) {
    UartReply reply;
    reply.positions = {0x0001, 0xFFFF, 0x8000, 0x1234, 5, 6, 7, 8};
    reply.velocities = {-1, 2, -3, 4, 5, 6, 7, 8};
    reply.forces = {-2, 0x0102, 3, 4};
    Bytes in(17);
    ASSERT_EQ(encode_reply(1, kUartB3M, reply, in), PacketDefect::None);
    EXPECT_EQ(in, bytes({0x31, 0x01, 0x00, 0xFF, 0xFF, 0x00, 0x80, 0x34, 0x12, 0xFF, 0xFF, 0x02, 0x00, 0xFD, 0xFF, 0x04,
                         0x00}));
    Bytes wide(41);
    ASSERT_EQ(encode_reply(1, kUartB5M, reply, wide), PacketDefect::None);
    EXPECT_EQ(wide, bytes({0x31, 0x01, 0x00, 0xFF, 0xFF, 0x00, 0x80, 0x34, 0x12, 0x05, 0x00, 0x06, 0x00, 0x07,
                           0x00, 0x08, 0x00, 0xFF, 0xFF, 0x02, 0x00, 0xFD, 0xFF, 0x04, 0x00, 0x05, 0x00, 0x06,
                           0x00, 0x07, 0x00, 0x08, 0x00, 0xFE, 0xFF, 0x02, 0x01, 0x03, 0x00, 0x04, 0x00}));
    UartReply back;
    ASSERT_EQ(decode_reply(wide, 1, kUartB5M, back), PacketDefect::None);
    EXPECT_EQ(back, reply);
}

TEST(UartCodec, HeadersGoThereAndBack) {
    for (int byte = 0; byte < 256; ++byte) {
        const UartHeader header = decode_header(static_cast<std::byte>(byte));
        EXPECT_EQ(header.id, byte % 8);
        EXPECT_EQ(header.command, byte / 8);
        EXPECT_EQ(encode_header(header), static_cast<std::byte>(byte));
    }
}

TEST(UartCodec, EveryFlippedBitOfAHeaderIsSeen) {
    UartReply reply;
    Bytes in(17);
    ASSERT_EQ(encode_reply(1, kUartB3M, reply, in), PacketDefect::None);
    for (unsigned bit = 0; bit < 8; ++bit) {
        Bytes flipped = in;
        flipped[0] ^= static_cast<std::byte>(1U << bit);
        EXPECT_EQ(decode_reply(flipped, 1, kUartB3M, reply), PacketDefect::Opcode);
    }
}

TEST(UartCodec, RefusesOtherLengthsAndKeepsWhatItHad) {
    const Bytes any(100, std::byte{0x31});
    UartReply reply;
    reply.positions.fill(7);
    const UartReply reply_before = reply;
    UartCurrents currents = kCurrents;
    UartBoardInfo info = kUartB5M;
    UartLengths lengths{9};
    for (std::size_t length = 0; length < any.size(); ++length) {
        const auto part = std::span(any).first(length);
        if (length != 17) {
            EXPECT_EQ(decode_reply(part, 1, kUartB3M, reply), PacketDefect::Length) << length;
        }
        if (length != 9) {
            EXPECT_EQ(decode_currents(part, 1, kUartB3M, currents), PacketDefect::Length) << length;
        }
        EXPECT_NE(decode_info(part, 1, info), PacketDefect::None);
        EXPECT_NE(decode_lengths(part, 1, lengths), PacketDefect::None);
    }
    EXPECT_EQ(reply, reply_before);
    EXPECT_EQ(currents, kCurrents);
    EXPECT_EQ(info, kUartB5M);
    EXPECT_EQ(lengths, UartLengths{9});
}

TEST(UartCodec, EncodersTouchNothingThatIsNotAsLongAsTheirPacket) {
    for (std::size_t length = 0; length < 60; ++length) {
        Bytes out(length, std::byte{0x5A});
        const Bytes before = out;
        EXPECT_EQ(encode_currents(0, kUartB5M, {}, out) == PacketDefect::None, length == 17);
        EXPECT_EQ(out == before, length != 17) << length;
    }
}

TEST(UartCodec, BoardRefusesACurrentBeyondItsRange) {
    for (const int beyond : {4096, -4096, 32767, -32768}) {
        Bytes out = bytes({0x30}, 9);
        out[3] = static_cast<std::byte>(beyond & 0xFF);
        out[4] = static_cast<std::byte>((beyond >> 8) & 0xFF);
        UartCurrents currents = kCurrents;
        EXPECT_EQ(decode_currents(out, 0, kUartB3M, currents), PacketDefect::DacCode);
        EXPECT_EQ(currents, kCurrents);
    }
}

TEST(UartCodec, UsableAreBoardsThatCanDriveOurStrings) {
    EXPECT_TRUE(is_usable(kUartB3M));
    EXPECT_TRUE(is_usable(kUartB5M));
    EXPECT_FALSE(is_usable({}));
    EXPECT_FALSE(is_usable({0, 12, 4, 4, 0, 0})) << "model 0 is none";
    EXPECT_FALSE(is_usable({5, 12, 0, 4, 0, 0}));
    EXPECT_FALSE(is_usable({5, 12, 9, 4, 0, 0}));
    EXPECT_FALSE(is_usable({5, 12, 8, 4, 5, 0}));
}

}  // namespace
}  // namespace haptic::device
