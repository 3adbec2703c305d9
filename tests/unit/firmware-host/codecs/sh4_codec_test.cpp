#include "codecs/sh4_codec.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "bytes.hpp"
#include "haptic/device/device_geometry.hpp"

namespace haptic::device {
namespace {

int at(const Sh4Packet& packet, std::size_t index) {
    return std::to_integer<int>(packet[index]);
}

TEST(Sh4Codec, MinimumTensionIsThePublishedPacket) {
    Sh4Command command;
    command.dac_codes.fill(
        static_cast<std::uint16_t>(dac_code_of_tension(0.3, spidar_g6_x3r().strings[0].newtons_per_code)));
    Sh4Packet out;
    out.fill(std::byte{0xAA});
    encode(command, out);

    Sh4Packet golden{};
    golden[0] = std::byte{0x01};
    golden[1] = std::byte{0x0E};
    for (std::size_t i = 0; i < kStrings; ++i) {
        golden[2 + 2 * i] = std::byte{0x2D};
        golden[3 + 2 * i] = std::byte{0x00};
    }
    EXPECT_EQ(out, golden);
}

TEST(Sh4Codec, DacCodesAreLittleEndianInChannelOrder) {
    Sh4Command command;
    command.dac_codes = {0x0102, 0x0203, 0x0304, 0x0405, 0x0506, 0x0607, 0x0708, 0x0809};
    Sh4Packet out;
    encode(command, out);
    const int golden[] = {0x01, 0x0E, 0x02, 0x01, 0x03, 0x02, 0x04, 0x03, 0x05, 0x04,
                          0x06, 0x05, 0x07, 0x06, 0x08, 0x07, 0x09, 0x08, 0x00, 0x00};
    for (std::size_t i = 0; i < std::size(golden); ++i) {
        EXPECT_EQ(at(out, i), golden[i]) << "byte " << i;
    }
}

TEST(Sh4Codec, HostNeverSendsMoreThanTwelveBits) {
    Sh4Command command;
    command.dac_codes = {4095, 4096, 5000, 65535, 0, 1, 4094, 32768};
    Sh4Packet out;
    encode(command, out);
    Sh4Command received;
    ASSERT_EQ(decode(std::span<const std::byte>(out), received), PacketDefect::None);
    EXPECT_EQ(received.dac_codes, (std::array<std::uint16_t, kStrings>{4095, 4095, 4095, 4095, 0, 1, 4094, 4095}));
}

TEST(Sh4Codec, BoardRefusesWhatIsNotACommand) {
    Sh4Packet out;
    encode(Sh4Command{}, out);
    const Sh4Command untouched{{1, 2, 3, 4, 5, 6, 7, 8}};
    Sh4Command command = untouched;

    EXPECT_EQ(decode(std::span<const std::byte>(out).first(511), command), PacketDefect::Length);
    EXPECT_EQ(decode(std::span<const std::byte>(out).first(0), command), PacketDefect::Length);
    const std::vector<std::byte> longer(513, std::byte{0});
    EXPECT_EQ(decode(std::span<const std::byte>(longer), command), PacketDefect::Length);

    Sh4Packet wrong = out;
    wrong[0] = std::byte{0x02};
    EXPECT_EQ(decode(std::span<const std::byte>(wrong), command), PacketDefect::Opcode);
    wrong = out;
    wrong[1] = std::byte{0x0F};
    EXPECT_EQ(decode(std::span<const std::byte>(wrong), command), PacketDefect::Opcode);
    wrong = out;
    wrong[17] = std::byte{0x10};  // channel 7: 0x1000, one more than 12 bits can hold
    EXPECT_EQ(decode(std::span<const std::byte>(wrong), command), PacketDefect::DacCode);

    EXPECT_EQ(command.dac_codes, untouched.dac_codes) << "a refused packet must not change the command";
}

TEST(Sh4Codec, BoardIgnoresTheRestOfTheCommand) {
    const Sh4Command sent{{9, 8, 7, 6, 5, 4, 3, 2}};
    Sh4Packet out;
    encode(sent, out);
    std::fill(out.begin() + 18, out.end(), std::byte{0xEE});
    Sh4Command received;
    ASSERT_EQ(decode(std::span<const std::byte>(out), received), PacketDefect::None);
    EXPECT_EQ(received.dac_codes, sent.dac_codes);
}

TEST(Sh4Codec, ReplyFieldsStandAtTheirOffsets) {
    Sh4Packet in{};
    for (std::size_t i = 0; i < in.size(); ++i) {
        in[i] = static_cast<std::byte>(i & 0xFFU);
    }
    Sh4Reply reply;
    ASSERT_EQ(decode(std::span<const std::byte>(in), reply), PacketDefect::None);
    for (std::size_t i = 0; i < kStrings; ++i) {
        const auto word = [&](std::size_t offset) { return (offset + 2 * i) + ((offset + 2 * i + 1) << 8U); };
        EXPECT_EQ(reply.dac_codes[i], word(0));
        EXPECT_EQ(reply.counters[i], word(16));
        EXPECT_EQ(reply.analog[i], word(32));
    }
    EXPECT_EQ(reply.pio, 0x3130);
    EXPECT_EQ(reply.info, 0x35343332U);
}

TEST(Sh4Codec, GoldenReply) {
    Sh4Reply reply;
    reply.dac_codes.fill(45);
    reply.counters = {0, 1, 65535, 32767, 32768, 6234, 65536 - 6234, 0x1234};
    reply.analog = {0, 4095, 1, 2, 3, 4, 5, 6};
    reply.pio = 0x00A5;
    reply.info = 0x12345678;
    Sh4Packet in;
    in.fill(std::byte{0x55});
    encode(reply, in);
    EXPECT_EQ(test::bytes_of(in),
              test::bytes({0x2D, 0x00, 0x2D, 0x00, 0x2D, 0x00, 0x2D, 0x00, 0x2D, 0x00, 0x2D, 0x00, 0x2D, 0x00,
                           0x2D, 0x00, 0x00, 0x00, 0x01, 0x00, 0xFF, 0xFF, 0xFF, 0x7F, 0x00, 0x80, 0x5A, 0x18,
                           0xA6, 0xE7, 0x34, 0x12, 0x00, 0x00, 0xFF, 0x0F, 0x01, 0x00, 0x02, 0x00, 0x03, 0x00,
                           0x04, 0x00, 0x05, 0x00, 0x06, 0x00, 0xA5, 0x00, 0x78, 0x56, 0x34, 0x12},
                          512));
}

TEST(Sh4Codec, HostRefusesARepliesOfAnotherLengthAndKeepsTheLastOne) {
    Sh4Reply reply;
    reply.info = 7;
    const std::vector<std::byte> bytes(1024, std::byte{0xFF});
    for (const std::size_t length : {0U, 1U, 53U, 54U, 511U, 513U, 1024U}) {
        EXPECT_EQ(decode(std::span<const std::byte>(bytes).first(length), reply), PacketDefect::Length) << length;
    }
    EXPECT_EQ(reply.info, 7U);
    EXPECT_EQ(reply.counters[0], 0U);
}

TEST(Sh4Codec, EveryReplyComesThroughUnchanged) {
    std::mt19937 random(20);
    std::uniform_int_distribution<std::uint32_t> any;
    for (int k = 0; k < 1000; ++k) {
        Sh4Reply sent;
        for (std::size_t i = 0; i < kStrings; ++i) {
            sent.dac_codes[i] = static_cast<std::uint16_t>(any(random));
            sent.counters[i] = static_cast<std::uint16_t>(any(random));
            sent.analog[i] = static_cast<std::uint16_t>(any(random));
        }
        sent.pio = static_cast<std::uint16_t>(any(random));
        sent.info = any(random);
        Sh4Packet in;
        in.fill(std::byte{0x55});
        encode(sent, in);
        Sh4Reply received;
        ASSERT_EQ(decode(std::span<const std::byte>(in), received), PacketDefect::None);
        EXPECT_EQ(received.dac_codes, sent.dac_codes);
        EXPECT_EQ(received.counters, sent.counters);
        EXPECT_EQ(received.analog, sent.analog);
        EXPECT_EQ(received.pio, sent.pio);
        EXPECT_EQ(received.info, sent.info);
        for (std::size_t i = 54; i < in.size(); ++i) {
            ASSERT_EQ(at(in, i), 0);
        }
    }
}

}  // namespace
}  // namespace haptic::device
