#include "emulated/faulty_firmware.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <string>

#include "codecs/sh4_codec.hpp"
#include "emulated/emulated_transport.hpp"
#include "emulated/make_firmware.hpp"
#include "haptic/device/emulated_device.hpp"
#include "sample_device.hpp"

namespace haptic::device {
namespace {

using test::kMs;

using Bytes = std::vector<std::byte>;

Bytes command(std::uint16_t dac_code) {
    Sh4Command sent;
    sent.dac_codes.fill(dac_code);
    Sh4Packet packet;
    encode(sent, packet);
    return {packet.begin(), packet.end()};
}

/// An SH4 board behind a faulty cable. Exchange k is at k ms and sends DAC code k, so that the echo of a reply
/// identifies its command.
class FaultyCable {
  public:
    explicit FaultyCable(const std::vector<std::string>& faults) : device_(settings(faults)) {
        firmware_ = make_firmware(BoardKind::Sh4, device_);
    }

    /// The reply; empty if none.
    Bytes exchange(int k) {
        const Bytes out = command(static_cast<std::uint16_t>(k));
        firmware_->receive(out, k * kMs);
        return fetch(k);
    }
    Bytes fetch(int k) {
        Bytes in(512);
        in.resize(firmware_->reply(in, k * kMs));
        return in;
    }
    /// DAC codes echoed by the replies of exchanges 0..count-1; -1: no reply, -2: an invalid reply.
    std::vector<int> echoes(int count) {
        std::vector<int> echoes;
        for (int k = 0; k < count; ++k) {
            echoes.push_back(echo_of(exchange(k)));
        }
        return echoes;
    }
    static int echo_of(const Bytes& in) {
        Sh4Reply reply;
        if (in.empty()) {
            return -1;
        }
        return decode(std::span<const std::byte>(in), reply) == PacketDefect::None ? reply.dac_codes[0] : -2;
    }

    EmulatedDevice device_;
    std::unique_ptr<Firmware> firmware_;

  private:
    static EmulatedDevice::Settings settings(const std::vector<std::string>& texts) {
        EmulatedDevice::Settings settings{.geometry = spidar_g6_x3r()};
        for (const std::string& text : texts) {
            settings.faults.push_back(parse_fault(text));
        }
        return settings;
    }
};

TEST(FaultyFirmware, ASoundCableIsNoneAtAll) {
    FaultyCable cable({"jump@0"});  // a device fault
    EXPECT_EQ(dynamic_cast<FaultyFirmware*>(cable.firmware_.get()), nullptr);
    EXPECT_EQ(cable.echoes(4), (std::vector<int>{0, 1, 2, 3}));
}

TEST(FaultyFirmware, DroppedAnswersComeNotAndTheBoardDidWhatItWasTold) {
    FaultyCable cable({"drop@0.002/0.002"});
    EXPECT_EQ(cable.echoes(3), (std::vector<int>{0, 1, -1}));
    EXPECT_EQ(cable.device_.dac_codes()[0], 2);
    EXPECT_TRUE(cable.exchange(3).empty());
    EXPECT_EQ(cable.echo_of(cable.exchange(4)), 4) << "the fault is over";
}

TEST(FaultyFirmware, DroppedCommandsAreNeitherDoneNorAnswered) {
    FaultyCable cable({"drop@0.002/0.002:way=out"});
    EXPECT_EQ(cable.echoes(4), (std::vector<int>{0, 1, -1, -1}));
    EXPECT_EQ(cable.device_.dac_codes()[0], 1);
    EXPECT_EQ(cable.echo_of(cable.exchange(4)), 4);
}

TEST(FaultyFirmware, NoMorePacketsSufferThanWereAskedFor) {
    FaultyCable cable({"drop@0.001:packets=2"});
    EXPECT_EQ(cable.echoes(6), (std::vector<int>{0, -1, -1, 3, 4, 5}));
}

TEST(FaultyFirmware, DelayedAnswersComeInAnotherExchangeAndStayBehind) {
    // Nobody fetches twice, so the replies remain two behind after the delay has ended.
    FaultyCable cable({"delay@0.002/0.003:by=0.002"});
    EXPECT_EQ(cable.echoes(8), (std::vector<int>{0, 1, -1, -1, 2, 3, 4, 5}));
}

TEST(FaultyFirmware, DelayedAnswerIsThereOnceItsTimeHasCome) {
    FaultyCable cable({"delay@0.001:by=0.005"});
    EXPECT_EQ(cable.echoes(2), (std::vector<int>{0, -1}));
    EXPECT_TRUE(cable.fetch(5).empty());
    EXPECT_EQ(cable.echo_of(cable.fetch(6)), 1);
    EXPECT_TRUE(cable.fetch(7).empty());
}

TEST(FaultyFirmware, DelayedCommandsAreDoneLate) {
    FaultyCable cable({"delay@0.001/0.001:way=out,by=0.003"});
    EXPECT_EQ(cable.echoes(2), (std::vector<int>{0, -1}));
    EXPECT_EQ(cable.device_.dac_codes()[0], 0);
    EXPECT_EQ(cable.echo_of(cable.fetch(4)), 1);
    EXPECT_EQ(cable.device_.dac_codes()[0], 1);
}

TEST(FaultyFirmware, DuplicatedAnswersLeaveTheHostBehind) {
    FaultyCable cable({"duplicate@0.001/0.001"});
    EXPECT_EQ(cable.echoes(4), (std::vector<int>{0, 1, 1, 2}));
}

TEST(FaultyFirmware, DuplicatedCommandsAreAnsweredTwice) {
    FaultyCable cable({"duplicate@0.001/0.001:way=out"});
    EXPECT_EQ(cable.echoes(4), (std::vector<int>{0, 1, 1, 2}));
}

TEST(FaultyFirmware, TruncatedPacketsLoseTheirEnd) {
    FaultyCable cable({"truncate@0.001/0.001:bytes=53", "truncate@0.002/0.001"});
    EXPECT_EQ(cable.exchange(0).size(), 512U);
    EXPECT_EQ(cable.exchange(1).size(), 53U);
    EXPECT_EQ(cable.exchange(2).size(), 256U);
    EXPECT_EQ(cable.echo_of(cable.exchange(3)), 3);
    FaultyCable other({"truncate@0.001/0.001:way=out"});
    EXPECT_EQ(other.echoes(3), (std::vector<int>{0, -1, 2}));
    EXPECT_EQ(other.device_.dac_codes()[0], 2);
}

TEST(FaultyFirmware, FlippedPacketsDifferInOneBit) {
    for (const char* text : {"flip@0.001/0.010:bit=137", "flip@0.001/0.010"}) {
        FaultyCable sound({});
        FaultyCable flipped({text});
        for (int k = 0; k < 13; ++k) {
            const Bytes expected = sound.exchange(k);
            const Bytes got = flipped.exchange(k);
            ASSERT_EQ(got.size(), expected.size());
            int bits = 0;
            for (std::size_t i = 0; i < got.size(); ++i) {
                bits += std::popcount(std::to_integer<unsigned>(got[i] ^ expected[i]));
            }
            EXPECT_EQ(bits, k >= 1 && k < 11 ? 1 : 0) << text << ", exchange " << k;
        }
        if (std::string(text).ends_with("137")) {
            FaultyCable once({"flip@0:bit=137,packets=1"});
            FaultyCable never({});
            EXPECT_EQ(once.exchange(0)[17] ^ never.exchange(0)[17], std::byte{1 << 1});
        }
    }
}

TEST(FaultyFirmware, FlippedDacCodeReachesTheMotorOrIsRefused) {
    // Bit 16: bit 0 of string 0's DAC code. Bit 28: its bit 12, beyond the range of any DAC.
    FaultyCable low({"flip@0.001:way=out,bit=16"});
    EXPECT_EQ(low.echoes(3)[2], 3);
    FaultyCable high({"flip@0.001:way=out,bit=28"});
    EXPECT_EQ(high.echoes(3), (std::vector<int>{0, -1, -1}));
}

TEST(FaultyFirmware, UnpluggedCableIsDeadUntilItIsPluggedInAgain) {
    FaultyCable cable({"unplug@0.002/0.003"});
    EXPECT_EQ(cable.echoes(2), (std::vector<int>{0, 1}));
    EXPECT_TRUE(cable.firmware_->connected(1 * kMs));
    EXPECT_FALSE(cable.firmware_->connected(2 * kMs));
    EXPECT_TRUE(cable.exchange(3).empty());
    EXPECT_EQ(cable.device_.dac_codes()[0], 1) << "the motors keep what they had";
    EXPECT_TRUE(cable.firmware_->connected(5 * kMs));
    EXPECT_EQ(cable.echo_of(cable.exchange(5)), 5);
}

TEST(FaultyFirmware, WhatWasUnderWayIsLostWithTheCable) {
    FaultyCable cable({"delay@0.001/0.001:by=0.003", "unplug@0.002/0.001"});
    EXPECT_EQ(cable.echoes(2), (std::vector<int>{0, -1}));
    EXPECT_TRUE(cable.fetch(4).empty());
    EXPECT_EQ(cable.echo_of(cable.exchange(5)), 5);
}

TEST(FaultyFirmware, TransportSaysThatTheDeviceIsGone) {
    FaultyCable cable({"unplug@0.002/0.003"});
    EmulatedTransport transport(*cable.firmware_);
    const Bytes out = command(7);
    Bytes in(512);
    std::vector<ExchangeStatus> statuses;
    for (int k = 0; k < 7; ++k) {
        PacketExchange packets{{std::span<const std::byte>(out)}, std::span<std::byte>(in)};
        statuses.push_back(transport.exchange(packets, k * kMs));
    }
    using enum ExchangeStatus;
    EXPECT_EQ(statuses, (std::vector<ExchangeStatus>{Ok, Ok, Disconnected, Disconnected, Disconnected, Ok, Ok}));
}

TEST(FaultyFirmware, FaultsAddUp) {
    FaultyCable cable({"duplicate@0.001/0.001", "truncate@0.001/0.001:bytes=20"});
    EXPECT_EQ(cable.exchange(0).size(), 512U);
    EXPECT_EQ(cable.exchange(1).size(), 20U);
    EXPECT_EQ(cable.fetch(1).size(), 20U);
    EXPECT_TRUE(cable.fetch(1).empty());
}

TEST(FaultyFirmware, MorePacketsThanCanWaitAreLost) {
    FaultyCable cable({"delay@0:by=1"});
    for (int k = 0; k < 100; ++k) {
        cable.exchange(k);
    }
    int waiting = 0;
    while (!cable.fetch(5000).empty()) {
        ++waiting;
    }
    EXPECT_EQ(waiting, static_cast<int>(FaultyFirmware::kMaxWaiting));
}

TEST(FaultyFirmware, APacketThatIsTooLongStaysSo) {
    FaultyCable cable({"drop@5"});
    Bytes out = command(9);
    out.push_back(std::byte{0});
    cable.firmware_->receive(out, 0);
    EXPECT_TRUE(cable.fetch(0).empty());
    EXPECT_EQ(cable.device_.dac_codes()[0], 0);
}

}  // namespace
}  // namespace haptic::device
