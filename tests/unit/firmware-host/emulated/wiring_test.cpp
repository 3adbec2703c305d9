#include "haptic/device/wiring.hpp"

#include <gtest/gtest.h>

#include <string>

#include "haptic/device/device_geometry_file.hpp"
#include "haptic/device/emulated_device.hpp"
#include "sample_device.hpp"

namespace haptic::device {
namespace {

using test::kMs;

Wiring wired(std::string_view text) {
    Wiring wiring;
    add_wiring(wiring, text);
    return wiring;
}

std::string wiring_problem(std::string_view text) {
    try {
        static_cast<void>(wired(text));
        return {};
    } catch (const WiringError& error) {
        return error.what();
    }
}

EmulatedDevice::Settings wired_settings(std::string_view wiring, bool mechanical = false) {
    return {.geometry = built_in_geometry("SpidarG6X3R"),
            .mechanics = mechanical ? std::optional(GripMechanics()) : std::nullopt,
            .wiring = wired(wiring)};
}

/// Counts by which the channels' counters change while the hand, ideal, moves from the centre to `position`.
std::array<int, kStrings> counts_to(std::string_view wiring, const Vec3& position) {
    EmulatedDevice::Settings moving = wired_settings(wiring);
    moving.hand = PoseTrack(Pose{position, {1.0, 0.0, 0.0, 0.0}});
    const EmulatedDevice device(std::move(moving));
    std::array<int, kStrings> counts{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        counts[i] = static_cast<std::int16_t>(device.counters()[i]);  // the counters are zero at the centre
    }
    return counts;
}

/// A position that changes all lengths.
Vec3 aside() {
    return {0.004, 0.011, -0.007};
}

/// An impedance-held grip with one DAC code on one channel, after a time; all others carry the minimum tension.
struct Pulled {
    explicit Pulled(std::string_view wiring, std::size_t channel, std::int16_t code = 300)
        : device(wired_settings(wiring, true)) {
        std::array<std::int16_t, kStrings> codes{};
        codes.fill(46);  // 0.3 N
        device.set_dac_codes(codes);
        device.advance(0);
        device.advance(50 * kMs);
        before = device.counters();
        codes[channel] = code;
        device.set_dac_codes(codes);
        device.advance(80 * kMs);
        for (std::size_t i = 0; i < kStrings; ++i) {
            moved[i] = static_cast<std::int16_t>(device.counters()[i] - before[i]);
        }
    }

    EmulatedDevice device;
    std::array<std::uint32_t, kStrings> before{};
    std::array<int, kStrings> moved{};
};

TEST(Wiring, DefaultIsTheWiringOfTheGeometry) {
    EXPECT_TRUE(Wiring().correct());
    EXPECT_TRUE(wired("none").correct());
    EXPECT_FALSE(wired("sign:0").correct());
    EXPECT_EQ(counts_to("none", aside()), counts_to("motors:0,1+gain:3=2", aside())) << "motors do not change encoders";
}

TEST(Wiring, TextsSetWhatTheyName) {
    Wiring expected;
    expected.encoder_factor[3] = -1.0;
    expected.motor_of = {4, 1, 5, 3, 0, 2, 6, 7};
    expected.encoder_of = {0, 1, 5, 3, 4, 2, 6, 7};
    expected.gain[6] = 2.0;
    expected.encoder_factor[5] = 1.5;
    expected.dead[7] = true;
    expected.slack[1] = true;
    EXPECT_EQ(wired("sign:3+strings:2,5+motors:0,4+gain:6=2+counts:5=1.5+dead:7+slack:1"), expected);
    // Repetition adds, in the order of the texts.
    Wiring repeated;
    for (const char* text : {"sign:3", "strings:2,5", "motors:0,4", "gain:6=2", "counts:5=1.5", "dead:7", "slack:1"}) {
        add_wiring(repeated, text);
    }
    EXPECT_EQ(repeated, expected);
    EXPECT_TRUE(wired("encoders:1,2+encoders:2,1").correct());
    EXPECT_EQ(expected.channel_of_motor(5), 2U);
}

TEST(Wiring, RefusesTextsThatSayNothingDefinite) {
    EXPECT_NE(wiring_problem("sing:3").find("'sing' is no wiring error; the choices are sign, strings"),
              std::string::npos);
    EXPECT_NE(wiring_problem("sign:8").find("needs a number from 0 to 7, not '8'"), std::string::npos);
    EXPECT_NE(wiring_problem("motors:2,2").find("two different numbers"), std::string::npos);
    EXPECT_NE(wiring_problem("strings:2").find("two different numbers"), std::string::npos);
    EXPECT_NE(wiring_problem("gain:2").find("needs a factor"), std::string::npos);
    EXPECT_NE(wiring_problem("gain:2=nan").find("needs a factor"), std::string::npos);
    EXPECT_NE(wiring_problem("dead:2=1").find("has no factor"), std::string::npos);
    EXPECT_NE(wiring_problem("").find("no wiring error"), std::string::npos);
    Wiring wiring;
    EXPECT_THROW(add_wiring(wiring, "sign:1+sign:9"), WiringError);
    EXPECT_TRUE(wiring.correct()) << "a refused text leaves the wiring unchanged";
}

TEST(Wiring, DeviceRefusesAMotorWithoutAChannel) {
    EmulatedDevice::Settings broken = wired_settings("none");
    broken.wiring.motor_of[0] = 1;
    EXPECT_THROW(EmulatedDevice{std::move(broken)}, WiringError);
}

TEST(Wiring, ReversedEncoderCountsBackwards) {
    const auto right = counts_to("none", aside());
    const auto wrong = counts_to("sign:3", aside());
    ASSERT_GT(std::abs(right[3]), 100);
    EXPECT_NEAR(wrong[3], -right[3], 1);
    EXPECT_EQ(wrong[2], right[2]);
}

TEST(Wiring, SwappedEncodersCountEachOthersStrings) {
    // Strings 0 and 4 count in opposite directions on an X3R; the sign belongs to the encoder.
    const auto right = counts_to("none", aside());
    for (const char* text : {"encoders:0,4", "strings:0,4"}) {
        const auto wrong = counts_to(text, aside());
        EXPECT_EQ(wrong[0], right[4]);
        EXPECT_EQ(wrong[4], right[0]);
        EXPECT_EQ(wrong[1], right[1]);
    }
}

TEST(Wiring, EncoderFactorScalesTheCounts) {
    const auto right = counts_to("none", aside());
    EXPECT_NEAR(counts_to("counts:6=2", aside())[6], 2 * right[6], 1);
    EXPECT_EQ(counts_to("counts:6=0", aside())[6], 0);
}

TEST(Wiring, ChannelPullsTheStringOfItsMotor) {
    const double newtons = 300 * built_in_geometry("SpidarG6X3R").strings[0].newtons_per_code;
    const auto pull_of = [](const char* text, std::size_t channel) {
        EmulatedDevice device(wired_settings(text));
        std::array<std::int16_t, kStrings> codes{};
        codes[channel] = 300;
        device.set_dac_codes(codes);
        return device.tensions();
    };
    EXPECT_DOUBLE_EQ(pull_of("motors:0,4", 0)[4], newtons);
    EXPECT_DOUBLE_EQ(pull_of("motors:0,4", 0)[0], 0.0);
    EXPECT_DOUBLE_EQ(pull_of("strings:2,5", 5)[2], newtons);
    EXPECT_DOUBLE_EQ(pull_of("encoders:2,5", 5)[5], newtons);
    EXPECT_DOUBLE_EQ(pull_of("gain:6=2", 6)[6], 2.0 * newtons);
    EXPECT_DOUBLE_EQ(pull_of("gain:6=-1", 6)[6], 0.0);
    EXPECT_DOUBLE_EQ(pull_of("dead:7", 7)[7], 0.0);
    EXPECT_DOUBLE_EQ(pull_of("motors:0,4+dead:0", 0)[4], 0.0) << "the channel is dead, whatever motor it drives";
}

TEST(Wiring, PulledStringWindsInAtTheEncoderOfItsChannelOnlyIfWiredSo) {
    // Positive metres_per_count of string 0: winding in lowers the counter.
    const Pulled right("none", 0);
    EXPECT_LT(right.moved[0], -30);
    EXPECT_GT(Pulled("sign:0", 0).moved[0], 30);
    EXPECT_LT(Pulled("encoders:0,1", 0).moved[1], -30);
    EXPECT_GT(std::abs(Pulled("motors:0,6", 0).moved[6]), 30);
    EXPECT_NEAR(Pulled("dead:0", 0).moved[0], 0, 3);
    EXPECT_LT(Pulled("gain:0=2", 0).moved[0], 1.5 * right.moved[0]);
}

TEST(Wiring, MotorOfWrongPolarityUnwindsItsString) {
    const Pulled wrong("gain:0=-1", 0, 60);
    EXPECT_GT(wrong.moved[0], 100);
    EXPECT_EQ(wrong.device.string_tensions()[0], 0.0);
}

TEST(Wiring, SlackStringWindsAndItsKnotCarriesNothing) {
    for (const bool mechanical : {false, true}) {
        EmulatedDevice device(wired_settings("slack:1", mechanical));
        std::array<std::int16_t, kStrings> codes{};
        codes.fill(100);
        device.set_dac_codes(codes);
        device.advance(0);
        const auto before = device.counters();
        for (int k = 1; k <= 3000; ++k) {
            device.advance(k * kMs);
        }
        EXPECT_EQ(device.string_tensions()[1], 0.0);
        EXPECT_GT(device.string_tensions()[2], 0.4);
        EXPECT_GT(std::abs(static_cast<std::int16_t>(device.counters()[1] - before[1])), 5000) << mechanical;
    }
}

TEST(Wiring, IsThatOfTheGeometryWhereMotorsHaveOtherChannels) {
    EmulatedDevice::Settings exchanged = wired_settings("none");
    std::swap(exchanged.geometry.motor_channels[0], exchanged.geometry.motor_channels[4]);
    EmulatedDevice device(std::move(exchanged));
    device.set_dac_codes({300, 0, 0, 0, 0, 0, 0, 0});
    EXPECT_GT(device.tensions()[4], 1.0);
    EXPECT_EQ(device.tensions()[0], 0.0);
}

TEST(Wiring, HandPullsAStringOutAndItsMotorReelsItInAgain) {
    for (const bool mechanical : {false, true}) {
        EmulatedDevice device(wired_settings("none", mechanical));
        device.advance(0);
        const auto before = device.counters();
        device.pull_out(3, 0.05);
        const auto counts = [&] { return std::abs(static_cast<std::int16_t>(device.counters()[3] - before[3])); };
        EXPECT_NEAR(counts(), 0.05 / 1.66555e-5, 1.0) << "string 3 counts upward or downward";
        device.advance(kMs);
        EXPECT_NEAR(counts(), 0.05 / 1.66555e-5, 1.0) << "without current it stays out";
        std::array<std::int16_t, kStrings> codes{};
        codes[3] = 76;  // 0.5 N
        device.set_dac_codes(codes);
        for (int k = 2; k < 300; ++k) {
            device.advance(k * kMs);
        }
        EXPECT_LT(counts(), 200) << mechanical;
        EXPECT_NEAR(device.string_tensions()[3], 0.5, 0.03) << mechanical;
    }
}

TEST(Wiring, MotorsWithoutSupplyPullNothingWhateverTheirCodes) {
    EmulatedDevice device(wired_settings("none"));
    device.set_dac_codes({300, 300, 300, 300, 300, 300, 300, 300});
    device.set_motor_power(false);
    EXPECT_EQ(device.tensions(), (std::array<double, kStrings>{}));
    EXPECT_EQ(device.dac_codes()[0], 300) << "the board keeps them";
    device.set_motor_power(true);
    EXPECT_GT(device.tensions()[0], 1.0);
}

}  // namespace
}  // namespace haptic::device
