// UsbredirSession with hand-written bytes: what a guest may not send. Its other behaviour is in
// usbredir_server_test.cpp.
#include "usbredir/usbredir_session.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>

#include "codecs/sh4_codec.hpp"
#include "emulated/make_firmware.hpp"
#include "haptic/device/emulated_device.hpp"
#include "usbip_bytes.hpp"

namespace haptic::device {
namespace {

using test::Bytes;
using test::hex;
using test::joined;
using test::zeros;
using testing::HasSubstr;

constexpr std::size_t kHelloBytes = 12 + 64 + 4;

/// A hello with all capabilities that are needed.
Bytes hello() {
    return joined({hex("00000000 44000000 00000000"), zeros(64), hex("7a000000")});
}

/// Header of a message, little-endian, with id 1.
Bytes header(std::uint32_t type, std::uint32_t length) {
    Bytes bytes;
    for (const std::uint32_t word : {type, length, 1U, 0U}) {
        for (const unsigned shift : {0U, 8U, 16U, 24U}) {
            bytes.push_back(static_cast<std::byte>((word >> shift) & 0xFFU));
        }
    }
    return bytes;
}

/// A bulk transfer of an endpoint, without its data.
Bytes bulk(const char* endpoint, std::uint32_t data, const char* low, const char* high) {
    return joined({header(101, 10 + data), hex(endpoint), hex("00"), hex(low), hex("00000000"), hex(high)});
}

class RedirSession : public testing::Test {
  protected:
    Bytes reply_to(const Bytes& bytes) {
        session->receive(bytes, 0);
        Bytes reply;
        reply.swap(session->output());
        return reply;
    }

    EmulatedDevice device{{.geometry = spidar_g6_x3r()}};
    std::unique_ptr<Firmware> firmware = make_firmware(BoardKind::Sh4, device);
    ServedUsbDevice served{BoardKind::Sh4, *firmware, UsbSpeed::High};
    std::optional<UsbredirSession> session{std::in_place, served, true};
};

TEST_F(RedirSession, SaysHelloFirstAndTellsOfTheDeviceOnlyInAnswer) {
    EXPECT_EQ(session->output().size(), kHelloBytes);
    EXPECT_EQ(Bytes(session->output().end() - 4, session->output().end()), hex("7a000000"));
    EXPECT_FALSE(session->connected());
    EXPECT_EQ(reply_to(hello()).size(), kHelloBytes + (16 + 132) + (16 + 160) + (16 + 10));
    EXPECT_TRUE(session->connected());
}

TEST_F(RedirSession, BytesMayArriveOneByOne) {
    Bytes all;
    const Bytes out = joined({bulk("02", 512, "0002", "0000"), Bytes(512, std::byte{0})});
    for (const std::byte byte : joined({hello(), out, bulk("86", 0, "0002", "0000")})) {
        EXPECT_FALSE(session->ended());
        const Bytes reply = reply_to({byte});
        all.insert(all.end(), reply.begin(), reply.end());
    }
    // The OUT has been answered, the IN waits: a packet of zeros is no command.
    EXPECT_EQ(all.size(), kHelloBytes + (16 + 132) + (16 + 160) + (16 + 10) + (16 + 10));
    EXPECT_TRUE(session->waits_for_firmware());
}

TEST_F(RedirSession, WhatIsNoHelloEndsTheSession) {
    const Bytes cases[] = {
        hex("474554202f20485454502f312e310d0a"),                 // HTTP
        joined({hex("03000000 44000000 00000000"), zeros(68)}),  // a reset
        hex("00000000 3c000000 00000000"),                       // too short for a version
        hex("00000000 45000000 00000000"),                       // not whole words
        hex("00000000 ffffffff 00000000"),                       // endless
    };
    for (const Bytes& rubbish : cases) {
        session.emplace(served, true);
        session->output().clear();
        EXPECT_EQ(reply_to(rubbish), Bytes());
        EXPECT_TRUE(session->ended());
        EXPECT_THAT(session->reason(), HasSubstr("something else than a hello"));
    }
}

TEST_F(RedirSession, WhatTheProtocolDoesNotAllowEndsTheSessionAndReleasesTheDevice) {
    const struct {
        Bytes bytes;
        const char* reason;
    } cases[] = {
        {header(0, 68), "type 0"},                                   // a second hello
        {header(1, 10), "type 1"},                                   // the device's own
        {header(18, 8), "type 18"},                                  // a capability that we do not have
        {header(103, 4), "type 103"},                                // an endpoint that the board does not have
        {header(0xFFFFFFFF, 0), "type 4294967295"},                  //
        {header(6, 0), "type 6 with 0 bytes"},                       // no configuration
        {header(3, 0xFFFFFFFF), "type 3 with 4294967295 bytes"},     //
        {joined({header(6, 2), zeros(2)}), "2 bytes instead of 1"},  //
        {bulk("86", 4, "0002", "0000"), "14 bytes instead of 10"},   // data on IN
        {bulk("02", 4, "0002", "0000"), "14 bytes instead of 522"},  // less data than it says
        {bulk("86", 0, "0100", "0100"), "more than 65536 bytes"},
        {joined({header(100, 10), hex("00 09 00 00 0100 0000 0800")}), "10 bytes instead of 18"},
        {header(24, 0), "acknowledged"},
    };
    for (const auto& [bytes, reason] : cases) {
        session.emplace(served, true);
        reply_to(joined({hello(), bulk("86", 0, "0002", "0000")}));
        ASSERT_TRUE(session->waits_for_firmware());
        EXPECT_EQ(reply_to(bytes), Bytes());
        EXPECT_TRUE(session->ended()) << reason;
        EXPECT_THAT(session->reason(), HasSubstr(reason));
        EXPECT_FALSE(session->connected());
        EXPECT_FALSE(session->waits_for_firmware());
        EXPECT_EQ(reply_to(hello()), Bytes()) << "it is not read any more";
    }
}

TEST_F(RedirSession, MoreTransfersThanItKeepsEndTheSession) {
    reply_to(hello());
    for (std::size_t i = 0; i < ServedUsbDevice::kMaxPending; ++i) {
        reply_to(bulk("86", 0, "0002", "0000"));
    }
    EXPECT_FALSE(session->ended());
    reply_to(bulk("86", 0, "0002", "0000"));
    EXPECT_THAT(session->reason(), HasSubstr("more than 256 transfers"));
}

TEST_F(RedirSession, UnknownEndpointsStall) {
    reply_to(hello());
    const Bytes in = reply_to(bulk("81", 0, "0002", "0000"));
    ASSERT_EQ(in.size(), 16u + 10);
    EXPECT_EQ(in[17], std::byte{4});
    const Bytes out = reply_to(joined({bulk("01", 1, "0100", "0000"), zeros(1)}));
    ASSERT_EQ(out.size(), 16u + 10);
    EXPECT_EQ(out[17], std::byte{4});
}

}  // namespace
}  // namespace haptic::device
