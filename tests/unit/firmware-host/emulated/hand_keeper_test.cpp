#include "emulated/hand_keeper.hpp"

#include <gtest/gtest.h>

#include "codecs/sh4_codec.hpp"
#include "emulated/sh4_firmware.hpp"
#include "haptic/device/emulated_device.hpp"

namespace haptic::device {
namespace {

constexpr std::int64_t kMs = 1'000'000;
constexpr std::uint16_t kMinimum = 45;  // DAC code of 0.3 N on an X3R: trunc(0.3 * 0.365296803653 * 415)

class HandKeeperTest : public testing::Test {
  protected:
    /// One packet with the same DAC code for all motors except the last.
    void send(std::uint16_t dac_code, std::uint16_t last_dac_code, std::int64_t now_ns) {
        Sh4Command command;
        command.dac_codes.fill(dac_code);
        command.dac_codes.back() = last_dac_code;
        Sh4Packet packet;
        encode(command, packet);
        keeper.receive(packet, now_ns);
    }
    void send_each_ms(std::uint16_t dac_code, std::int64_t from_ms, std::int64_t to_ms) {
        for (std::int64_t ms = from_ms; ms < to_ms; ++ms) {
            send(dac_code, dac_code, ms * kMs);
        }
    }
    [[nodiscard]] double x() const { return device.grip_pose().position.x; }

    // 0.1 m/s along x from the start.
    EmulatedDevice device{{.geometry = spidar_g6_x3r(),
                           .hand = PoseTrack({0.0, 10.0}, {Pose{}, Pose{{1.0, 0.0, 0.0}, Quat(1.0, 0.0, 0.0, 0.0)}}),
                           .hand_waits = true}};
    Sh4Firmware board{device};
    HandKeeper keeper{board, device, 500 * kMs};
};

TEST_F(HandKeeperTest, TheHandWaitsUntilAllStringsHaveBeenTautForTheDelay) {
    send_each_ms(kMinimum - 1, 0, 1000);
    EXPECT_EQ(x(), 0.0) << "not taut yet";
    send_each_ms(kMinimum, 1000, 1500);
    EXPECT_EQ(x(), 0.0) << "the delay is not over";
    send_each_ms(kMinimum, 1500, 1601);
    EXPECT_NEAR(x(), 0.01, 1e-12);
}

TEST_F(HandKeeperTest, OneSlackStringIsEnoughToBeginAnew) {
    send_each_ms(kMinimum, 0, 400);
    send(kMinimum, kMinimum - 1, 400 * kMs);
    send_each_ms(kMinimum, 401, 901);
    EXPECT_EQ(x(), 0.0);
    send_each_ms(kMinimum, 901, 1002);
    EXPECT_NEAR(x(), 0.01, 1e-12);
}

TEST_F(HandKeeperTest, TheHandGoesBackWhenTheMotorsGoSlackAndFollowsItsTrackAnew) {
    send_each_ms(kMinimum, 0, 1001);
    EXPECT_NEAR(x(), 0.05, 1e-12);
    send_each_ms(0, 1001, 1252);
    EXPECT_GT(x(), 0.02);
    EXPECT_LT(x(), 0.03) << "half a second is not over: about half of the way";
    send_each_ms(0, 1252, 1600);
    EXPECT_EQ(x(), 0.0);
    send_each_ms(kMinimum, 1600, 2201);
    EXPECT_NEAR(x(), 0.01, 1e-12);
}

TEST_F(HandKeeperTest, AStringAloneThatGoesSlackDoesNotStopAMovingHand) {
    send_each_ms(kMinimum, 0, 600);
    send(kMinimum, 0, 600 * kMs);
    send_each_ms(kMinimum, 601, 701);
    EXPECT_NEAR(x(), 0.02, 1e-12);
}

TEST_F(HandKeeperTest, PassesAnswersOn) {
    send(kMinimum, kMinimum, 0);
    Sh4Packet in;
    EXPECT_EQ(keeper.reply(in, 0), in.size());
    EXPECT_EQ(keeper.reply(in, 0), 0u);
}

}  // namespace
}  // namespace haptic::device
