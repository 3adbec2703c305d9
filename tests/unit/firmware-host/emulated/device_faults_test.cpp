#include "emulated/device_faults.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "haptic/device/emulated_device.hpp"
#include "sample_device.hpp"

namespace haptic::device {
namespace {

using test::kLevel;
using test::kMs;
using test::kPulse;

/// A hand that moves away from motors 0 and 4 at 0.05 m/s.
EmulatedDevice::Settings moving(const std::vector<std::string>& faults) {
    EmulatedDevice::Settings settings{
        .geometry = spidar_g6_x3r(),
        .hand = PoseTrack({0.0, 0.4}, {{{0.0, 0.0, 0.0}, kLevel}, {{0.02, 0.0, 0.0}, kLevel}})};
    settings.power_up.fill(30'000);
    for (const std::string& text : faults) {
        settings.faults.push_back(parse_fault(text));
    }
    return settings;
}

/// Compares the encoders of a faulty device with those of a faultless one, millisecond by millisecond.
class Pair {
  public:
    explicit Pair(EmulatedDevice::Settings settings) : faulty_(settings), sound_(without(settings)) {}

    void run_to(int ms) {
        for (; ms_ <= ms; ++ms_) {
            faulty_.advance(ms_ * kMs);
            sound_.advance(ms_ * kMs);
            for (EmulatedDevice* device : {&faulty_, &sound_}) {
                device->set_dac_codes(dac_codes_);
            }
        }
    }
    [[nodiscard]] int difference(std::size_t string) const {
        return static_cast<std::int16_t>(faulty_.counters()[string] - sound_.counters()[string]);
    }

    EmulatedDevice faulty_;
    EmulatedDevice sound_;
    std::array<std::int16_t, kStrings> dac_codes_{45, 45, 45, 45, 45, 45, 45, 45};

  private:
    static EmulatedDevice::Settings without(EmulatedDevice::Settings settings) {
        settings.faults.clear();
        return settings;
    }
    int ms_ = 0;
};

TEST(DeviceFaults, StuckEncoderStandsStillAndIsRightAgainAfterwards) {
    Pair pair(moving({"stuck@0.1/0.1:string=4"}));
    pair.run_to(99);
    EXPECT_EQ(pair.difference(4), 0);
    pair.run_to(100);
    const auto held = pair.faulty_.counters();
    pair.run_to(199);
    EXPECT_EQ(pair.faulty_.counters()[4], held[4]);
    EXPECT_GT(pair.difference(4), 100);  // sign -: the true counter falls
    EXPECT_EQ(pair.difference(0), 0);
    pair.run_to(200);
    EXPECT_EQ(pair.difference(4), 0);
}

TEST(DeviceFaults, AllEncodersCanStandStill) {
    Pair pair(moving({"stuck@0.1:string=all"}));
    pair.run_to(100);
    const auto held = pair.faulty_.counters();
    pair.run_to(300);
    EXPECT_EQ(pair.faulty_.counters(), held);
}

TEST(DeviceFaults, JumpAddsItsCountsWrapsAndGoesBack) {
    Pair pair(moving({"jump@0.1/0.1:string=3,counts=-31000", "jump@0.15/0.1:string=3,counts=7"}));
    pair.run_to(99);
    EXPECT_EQ(pair.difference(3), 0);
    pair.run_to(100);
    EXPECT_EQ(pair.difference(3), -31'000);
    EXPECT_LT(pair.faulty_.counters()[3], 65'536U);
    pair.run_to(150);
    EXPECT_EQ(pair.difference(3), -30'993);
    EXPECT_EQ(pair.difference(2), 0);
    pair.run_to(200);
    EXPECT_EQ(pair.difference(3), 7);
    pair.run_to(250);
    EXPECT_EQ(pair.difference(3), 0);
}

TEST(DeviceFaults, FrozenMotorsKeepWhatTheyHadAndTheEchoSaysSoOrNot) {
    for (const bool echo_frozen : {true, false}) {
        Pair pair(moving({std::string("dac@0.1/0.1:echo=") + (echo_frozen ? "frozen" : "sent")}));
        pair.run_to(100);
        const auto before = pair.dac_codes_;
        pair.dac_codes_.fill(900);
        pair.run_to(150);
        EXPECT_EQ(pair.faulty_.dac_codes(), before);
        EXPECT_EQ(pair.faulty_.echo(), echo_frozen ? before : pair.dac_codes_);
        EXPECT_DOUBLE_EQ(pair.faulty_.tensions()[0], 45 * spidar_g6_x3r().strings[0].newtons_per_code);
        pair.run_to(200);
        EXPECT_EQ(pair.faulty_.dac_codes(), pair.dac_codes_);
    }
}

TEST(DeviceFaults, WithoutMechanicsASlackStringPullsNothingUntilItIsReeledIn) {
    Pair pair(moving({"slack@0.1/0.2:string=6,metres=0.02"}));
    pair.run_to(99);
    EXPECT_GT(pair.faulty_.string_tensions()[6], 0.29);
    pair.run_to(100);
    EXPECT_EQ(pair.faulty_.string_tensions()[6], 0.0);
    EXPECT_NE(glm::length(pair.faulty_.wrench().force - pair.sound_.wrench().force), 0.0);
    pair.run_to(120);  // 20 ms at 0.5 m/s
    EXPECT_NEAR(pair.difference(6) * kPulse, -0.0105, 1e-4);
    pair.run_to(145);
    EXPECT_NEAR(pair.difference(6) * kPulse, -0.02, 2e-5);
    EXPECT_GT(pair.faulty_.string_tensions()[6], 0.29);
    pair.run_to(310);
    EXPECT_LT(std::abs(pair.difference(6)), 1201);  // returning at 0.5 m/s
    pair.run_to(345);
    EXPECT_EQ(pair.difference(6), 0);
    EXPECT_GT(pair.faulty_.string_tensions()[6], 0.29);
}

TEST(DeviceFaults, WithMechanicsTheMotorReelsASlackStringInAndItIsTakenBackGently) {
    EmulatedDevice::Settings settings = moving({"slack@0.2/0.5:string=6,metres=0.02"});
    settings.hand = PoseTrack();
    settings.mechanics = GripMechanics{};
    Pair pair(std::move(settings));
    pair.run_to(200);
    EXPECT_EQ(pair.faulty_.string_tensions()[6], 0.0);
    pair.run_to(210);
    // 10 ms of (0.3 - 0.02) N on 15 g: 1 mm.
    EXPECT_NEAR(pair.difference(6) * kPulse, -0.5 * (0.277 / 0.015) * 1e-4, 2e-4);
    double largest = 0.0;
    for (int ms = 211; ms <= 900; ++ms) {
        pair.run_to(ms);
        largest = std::max(largest, pair.faulty_.string_tensions()[6]);
        if (ms == 650) {
            EXPECT_NEAR(pair.difference(6) * kPulse, -0.02, 1e-4);
        }
    }
    EXPECT_LT(std::abs(pair.difference(6)), 10);
    // Bound for a motor that reels in at 0.8 m/s and one that is pulled at 0.5 m/s: v sqrt(k m) = 14 N.
    EXPECT_LT(largest, 20.0);
}

TEST(DeviceFaults, DeadMotorReelsNothingInAndTurnsWithItsTautString) {
    // Away from motors 0 and 4 (left) and toward 2 and 6 (right) until 0.2 s, then back beyond the start.
    for (const bool mechanics : {false, true}) {
        EmulatedDevice::Settings settings = moving({"slack@0.1/0.6:string=6,metres=0,motor=dead"});
        settings.hand = PoseTrack({0.0, 0.2, 0.6},
                                  {{{0.0, 0.0, 0.0}, kLevel}, {{0.01, 0.0, 0.0}, kLevel}, {{-0.01, 0.0, 0.0}, kLevel}});
        if (mechanics) {
            settings.mechanics = GripMechanics{};
        }
        Pair pair(std::move(settings));
        pair.run_to(100);
        const auto held = pair.faulty_.counters();
        pair.run_to(200);
        EXPECT_LT(std::abs(static_cast<int>(pair.faulty_.counters()[6]) - static_cast<int>(held[6])), 10);
        EXPECT_GT(pair.difference(6) * kPulse, 0.003) << "it reads longer than the string is";
        EXPECT_EQ(pair.faulty_.string_tensions()[6], 0.0);
        EXPECT_EQ(pair.faulty_.tensions()[6], 0.0);
        pair.run_to(600);
        // Taut again, it pays out with the grip. With mechanics, the seven other strings limit the grip's position.
        EXPECT_LT(std::abs(pair.difference(6) * kPulse), mechanics ? 1e-3 : 2e-5);
        pair.run_to(900);
        EXPECT_LT(std::abs(pair.difference(6)), 10);
        EXPECT_GT(pair.faulty_.string_tensions()[6], 0.25);
    }
}

TEST(DeviceFaults, ClockWaitsForTheHandWhereItIsTold) {
    EmulatedDevice::Settings settings = moving({"jump@0.1:string=3,counts=100"});
    settings.hand_waits = true;
    settings.faults_wait = true;
    Pair pair(std::move(settings));
    pair.run_to(1000);
    EXPECT_EQ(pair.difference(3), 0);
    EXPECT_LT(pair.faulty_.fault_time_ns(1000 * kMs), 0);
    pair.faulty_.release_hand();
    pair.sound_.release_hand();
    pair.run_to(1099);
    EXPECT_EQ(pair.difference(3), 0);
    pair.run_to(1100);
    EXPECT_EQ(pair.difference(3), 100);
    EXPECT_EQ(pair.faulty_.fault_time_ns(1100 * kMs + 5), 100 * kMs + 5);
}

TEST(DeviceFaults, ClockBeginsWithTheFirstExchangeOtherwise) {
    EmulatedDevice device(moving({"stuck@0.05"}));
    EXPECT_LT(device.fault_time_ns(123), 0);
    device.advance(1'000 * kMs);
    EXPECT_EQ(device.fault_time_ns(1'000 * kMs), 0);
    EXPECT_EQ(device.fault_time_ns(1'007 * kMs), 7 * kMs);
}

}  // namespace
}  // namespace haptic::device
