#include "codecs/simple_codec.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "bytes.hpp"
#include "haptic/device/device_geometry.hpp"

namespace haptic::device {
namespace {

using test::bytes;
using test::bytes_of;

SimplePacket encoded(const SimpleCommand& command) {
    SimplePacket out;
    out.fill(std::byte{0xAA});
    encode(command, out);
    return out;
}

TEST(SimpleCodec, MinimumTensionIsThePublishedPacket) {
    SimpleCommand command{.request = SimpleRequest::DacCodes};
    command.dac_codes.fill(
        static_cast<std::uint16_t>(dac_code_of_tension(0.3, spidar_g6_x3r().strings[0].newtons_per_code)));
    EXPECT_EQ(bytes_of(encoded(command)),
              bytes({0x52, 0x2D, 0, 0x2D, 0, 0x2D, 0, 0x2D, 0, 0x2D, 0, 0x2D, 0, 0x2D, 0, 0x2D, 0}, 32));
}

TEST(SimpleCodec, StartUpAndLatchAreThePublishedPackets) {
    EXPECT_EQ(bytes_of(encoded({.request = SimpleRequest::Phase, .channels = 0xFF})), bytes({0xA2, 0x1A, 0xFF}, 32));
    EXPECT_EQ(bytes_of(encoded({.request = SimpleRequest::Clear, .channels = 0x5A})), bytes({0xA2, 0x19, 0x5A}, 32));
    EXPECT_EQ(bytes_of(encoded({.request = SimpleRequest::Latch})), bytes({0x51}, 32));
}

TEST(SimpleCodec, DacCodesAreLittleEndianInChannelOrder) {
    SimpleCommand command{.request = SimpleRequest::DacCodes};
    command.dac_codes = {0x0102, 0x0203, 0x0304, 0x0405, 0x0506, 0x0607, 0x0708, 0x0809};
    EXPECT_EQ(bytes_of(encoded(command)), bytes({0x52, 0x02, 0x01, 0x03, 0x02, 0x04, 0x03, 0x05, 0x04, 0x06, 0x05, 0x07,
                                                 0x06, 0x08, 0x07, 0x09, 0x08},
                                                32));
}

TEST(SimpleCodec, HostNeverSendsMoreThanTwelveBits) {
    SimpleCommand command{.request = SimpleRequest::DacCodes};
    command.dac_codes = {4095, 4096, 5000, 65535, 0, 1, 4094, 32768};
    SimpleCommand received;
    ASSERT_EQ(decode(std::span<const std::byte>(encoded(command)), received), PacketDefect::None);
    EXPECT_EQ(received.dac_codes, (std::array<std::uint16_t, kStrings>{4095, 4095, 4095, 4095, 0, 1, 4094, 4095}));
}

TEST(SimpleCodec, ReplyFieldsStandAtTheirOffsets) {
    SimplePacket in{};
    for (std::size_t i = 0; i < in.size(); ++i) {
        in[i] = static_cast<std::byte>(0xC0 + i);
    }
    SimpleReply reply;
    ASSERT_EQ(decode(std::span<const std::byte>(in), reply), PacketDefect::None);
    EXPECT_EQ(reply.counters, (std::array<std::uint32_t, kStrings>{0xC2C1C0, 0xC5C4C3, 0xC8C7C6, 0xCBCAC9, 0xCECDCC,
                                                                   0xD1D0CF, 0xD4D3D2, 0xD7D6D5}));
    EXPECT_EQ(reply.pio, 0xD8);
}

TEST(SimpleCodec, GoldenReply) {
    SimpleReply reply;
    reply.counters = {0, 1, 0xFFFFFF, 0x7FFFFF, 0x800000, 6234, 0xFFFFFF - 6233, 0x123456};
    reply.pio = 0xA5;
    SimplePacket in;
    in.fill(std::byte{0x55});
    encode(reply, in);
    EXPECT_EQ(bytes_of(in), bytes({0x00, 0x00, 0x00, 0x01, 0x00, 0x00, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x7F, 0x00,
                                   0x00, 0x80, 0x5A, 0x18, 0x00, 0xA6, 0xE7, 0xFF, 0x56, 0x34, 0x12, 0xA5},
                                  32));
}

TEST(SimpleCodec, RefusesOtherLengthsAndKeepsWhatItHad) {
    const std::vector<std::byte> long_one(512, std::byte{0x51});
    const SimpleReply reply_before{{1, 2, 3, 4, 5, 6, 7, 8}, 9};
    const SimpleCommand command_before{SimpleRequest::Phase, 7, {1, 2, 3}};
    SimpleReply reply = reply_before;
    SimpleCommand command = command_before;
    for (std::size_t length = 0; length <= long_one.size(); ++length) {
        if (length != kSimplePacketBytes) {
            ASSERT_EQ(decode(std::span(long_one).first(length), reply), PacketDefect::Length);
            ASSERT_EQ(decode(std::span(long_one).first(length), command), PacketDefect::Length);
        }
    }
    EXPECT_EQ(reply, reply_before);
    EXPECT_EQ(command, command_before);
}

TEST(SimpleCodec, BoardRefusesEveryOtherOpcode) {
    SimpleCommand command;
    int known = 0;
    for (int first = 0; first < 256; ++first) {
        for (int second = 0; second < 256; ++second) {
            const auto packet = bytes({first, second, 0xFF}, kSimplePacketBytes);
            const PacketDefect defect = decode(std::span(packet), command);
            const bool encoders = first == 0xA2 && (second == 0x1A || second == 0x19);
            const bool dac_codes =
                first == 0x52;  // second and third are a DAC code's low and high byte: FF exceeds 12 bits
            const bool latch = first == 0x51;
            ASSERT_EQ(defect, encoders || latch ? PacketDefect::None
                              : dac_codes       ? PacketDefect::DacCode
                                                : PacketDefect::Opcode)
                << first << " " << second;
            known += defect == PacketDefect::None ? 1 : 0;
        }
    }
    EXPECT_EQ(known, 2 + 256);
}

TEST(SimpleCodec, BoardRefusesADacCodeBeyondTwelveBitsInEachChannel) {
    for (std::size_t i = 0; i < kStrings; ++i) {
        SimplePacket out = encoded({.request = SimpleRequest::DacCodes});
        out[2 + 2 * i] = std::byte{0x10};
        SimpleCommand command{.request = SimpleRequest::Clear};
        EXPECT_EQ(decode(std::span<const std::byte>(out), command), PacketDefect::DacCode);
        EXPECT_EQ(command.request, SimpleRequest::Clear);
    }
}

TEST(SimpleCodec, EveryReplyComesThroughUnchanged) {
    std::mt19937 random(24);
    std::uniform_int_distribution<std::uint32_t> any(0, 0xFFFFFF);
    for (int k = 0; k < 1000; ++k) {
        SimpleReply sent;
        std::generate(sent.counters.begin(), sent.counters.end(), [&] { return any(random); });
        sent.pio = static_cast<std::uint8_t>(any(random));
        SimplePacket in;
        in.fill(std::byte{0x55});
        encode(sent, in);
        SimpleReply received;
        ASSERT_EQ(decode(std::span<const std::byte>(in), received), PacketDefect::None);
        EXPECT_EQ(received, sent);
    }
}

}  // namespace
}  // namespace haptic::device
