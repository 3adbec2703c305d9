#include "device/bringup.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <stdexcept>
#include <vector>

#include "haptic/device/device_geometry_file.hpp"

namespace haptic::rt {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr std::int64_t kSecond = 1'000'000'000;

device::DeviceGeometry x3r() {
    return device::built_in_geometry("SpidarG6X3R");
}

/// What is found on a device of which nothing differs from the geometry.
BringupFindings sound(const device::DeviceGeometry& geometry) {
    BringupFindings findings;
    for (std::size_t i = 0; i < kStrings; ++i) {
        const device::StringFacts& string = geometry.strings[i];
        findings.encoder_of_string[i] = {true, static_cast<int>(i), string.metres_per_count};
        findings.motor_of_channel[i] = {
            .state = MotorState::Pulls,
            .string = static_cast<int>(i),
            .code = static_cast<std::int16_t>(std::copysign(50.0, string.newtons_per_code))};
        findings.weight_of_string[i] = {std::fabs(string.newtons_per_code), 0.0, 0.0};
    }
    return findings;
}

/// The geometry that was found. Throws where there is none.
device::DeviceGeometry geometry_of(const BringupResult& result) {
    if (!result.geometry) {
        throw std::runtime_error("no geometry describes the device");
    }
    return *result.geometry;
}

WeighingFit fit_of(const std::vector<Weighing>& weighings) {
    const std::optional<WeighingFit> fit = fit_weighings(weighings);
    if (!fit) {
        throw std::runtime_error("the readings have no fit");
    }
    return *fit;
}

/// The texts of all deviations, and whether one must be fixed.
std::string all_of(const BringupResult& result) {
    std::string text;
    for (const Deviation& one : result.deviations) {
        text += (one.must_be_fixed ? "! " : "") + one.what + "; " + one.meaning + "\n";
    }
    return text;
}

TEST(PullOut, IsFollowedByTheCounterThatChangedByItsLength) {
    const device::StringFacts nominal{.metres_per_count = 2e-5};
    const EncoderFinding found = judge_pull_out({0.05, {0, 1, -2, 0, -2500, 30, 0, 0}}, nominal);
    EXPECT_EQ(found.channel, 4);
    EXPECT_DOUBLE_EQ(found.metres_per_count, -2e-5);
}

TEST(PullOut, IsFollowedByNoneIfNothingOrTwoCountersChange) {
    const device::StringFacts nominal{.metres_per_count = 2e-5};
    EXPECT_FALSE(judge_pull_out({0.05, {0, 0, 5, 0, 0, 0, 0, 0}}, nominal).found()) << "less than a quarter of 2500";
    EXPECT_FALSE(judge_pull_out({0.05, {0, 2500, 0, 1300, 0, 0, 0, 0}}, nominal).found());
    EXPECT_TRUE(judge_pull_out({0.05, {0, 2500, 0, 1200, 0, 0, 0, 0}}, nominal).found());
    EXPECT_TRUE(judge_pull_out({0.05, {}}, nominal).tried);
}

TEST(MotorPull, OfAStringThatWasSeenPulls) {
    const BringupFindings findings = sound(x3r());
    // X3R: string 0 counts upward, string 2 downward while it pays out.
    MotorPull pull{.code = 50, .counts = {-3000, 0, -500, 0, 0, 0, 0, 0}, .seen = 0};
    const MotorFinding found = judge_motor(pull, findings.encoder_of_string);
    EXPECT_EQ(found.state, MotorState::Pulls);
    EXPECT_EQ(found.string, 0);
    EXPECT_NEAR(found.movement, -3000 * 1.66555e-5, 1e-9);
    EXPECT_FALSE(found.contradicts);
    pull.seen = 5;
    EXPECT_TRUE(judge_motor(pull, findings.encoder_of_string).contradicts) << "the counter of string 0 was wound in";
}

TEST(MotorPull, WithoutATightStringPushesWindsOrStandsStill) {
    const auto encoders = sound(x3r()).encoder_of_string;
    EXPECT_EQ(judge_motor({50, {+1000, 0, 0, 0, 0, 0, 0, 0}, -1}, encoders).state, MotorState::Pushes);
    EXPECT_EQ(judge_motor({50, {-9000, 0, 0, 0, 0, 0, 0, 0}, -1}, encoders).state, MotorState::Winds);
    EXPECT_EQ(judge_motor({50, {0, 0, +9000, 0, 0, 0, 0, 0}, -1}, encoders).string, 2) << "string 2 counts downward";
    EXPECT_EQ(judge_motor({50, {0, 2, -1, 0, 0, 0, 3, 0}, -1}, encoders).state, MotorState::Still);
}

TEST(Weighings, GiveSlopeAndFriction) {
    // 7 mN a code, held back by 0.05 N.
    const WeighingFit fit = fit_of({{50, 0.30}, {100, 0.65}, {150, 1.00}});
    EXPECT_NEAR(fit.newtons_per_code, 0.007, 1e-12);
    EXPECT_NEAR(fit.friction, 0.05, 1e-12);
    EXPECT_NEAR(fit.rms, 0.0, 1e-12);
    EXPECT_NEAR(fit_of({{31, 0.2 * 9.80665}}).newtons_per_code, 0.2 * 9.80665 / 31, 1e-12);
    EXPECT_FALSE(fit_weighings({}));
    EXPECT_FALSE(fit_weighings({{50, 0.5}, {100, 0.4}})) << "less tension at a higher code";
    EXPECT_FALSE(fit_weighings({{0, 0.5}}));
}

TEST(BringupJudge, FindsNothingOnASoundDevice) {
    for (const char* name : {"SpidarG6X3R", "SpidarG6X4"}) {
        const device::DeviceGeometry nominal = device::built_in_geometry(name);
        const BringupResult result = judge_bringup(nominal, sound(nominal));
        EXPECT_THAT(all_of(result), IsEmpty());
        ASSERT_TRUE(result.geometry);
        EXPECT_EQ(geometry_of(result), nominal);
    }
}

TEST(BringupJudge, ReordersExchangedStrings) {
    const device::DeviceGeometry nominal = x3r();
    BringupFindings findings = sound(nominal);
    std::swap(findings.encoder_of_string[2].channel, findings.encoder_of_string[5].channel);
    std::swap(findings.motor_of_channel[2].string, findings.motor_of_channel[5].string);
    const BringupResult result = judge_bringup(nominal, findings);
    EXPECT_THAT(all_of(result), AllOf(HasSubstr("string 2 ("), HasSubstr("is on channel 5 instead of 2")));
    EXPECT_EQ(geometry_of(result).strings[5].motor, nominal.strings[2].motor);
    EXPECT_EQ(geometry_of(result).strings[2].motor, nominal.strings[5].motor);
    EXPECT_EQ(geometry_of(result).motor_channels, nominal.motor_channels);
}

TEST(BringupJudge, GivesExchangedMotorsTheirChannels) {
    const device::DeviceGeometry nominal = x3r();
    BringupFindings findings = sound(nominal);
    std::swap(findings.motor_of_channel[0].string, findings.motor_of_channel[4].string);
    const BringupResult result = judge_bringup(nominal, findings);
    EXPECT_THAT(all_of(result), HasSubstr("the motor of string 0 ("));
    EXPECT_EQ(geometry_of(result).strings, nominal.strings);
    EXPECT_EQ(geometry_of(result).motor_channels, (std::array<std::uint8_t, kStrings>{4, 1, 2, 3, 0, 5, 6, 7}));
}

TEST(BringupJudge, ReversesSignsWhereTheBoardCan) {
    const device::DeviceGeometry nominal = device::built_in_geometry("SpidarG6X4");
    BringupFindings findings = sound(nominal);
    findings.encoder_of_string[3].metres_per_count *= -1.0;
    findings.motor_of_channel[6].code = static_cast<std::int16_t>(-findings.motor_of_channel[6].code);
    const BringupResult result = judge_bringup(nominal, findings);
    EXPECT_THAT(all_of(result),
                AllOf(HasSubstr("counts backwards"), HasSubstr("codes of the other sign"), Not(HasSubstr("!"))));
    EXPECT_EQ(geometry_of(result).strings[3].metres_per_count, -nominal.strings[3].metres_per_count);
    EXPECT_EQ(geometry_of(result).strings[6].newtons_per_code, -nominal.strings[6].newtons_per_code);
}

TEST(BringupJudge, SendsADeviceThatCannotPullToTheWorkshop) {
    const device::DeviceGeometry nominal = x3r();
    const auto with = [&](std::size_t channel, MotorState state) {
        BringupFindings findings = sound(nominal);
        findings.motor_of_channel[channel].state = state;
        if (state == MotorState::Still) {
            findings.motor_of_channel[channel].string = -1;
        }
        return judge_bringup(nominal, findings);
    };
    EXPECT_THAT(all_of(with(7, MotorState::Still)), HasSubstr("! the motor of channel 7 does not pull"));
    EXPECT_FALSE(with(7, MotorState::Still).geometry);
    EXPECT_THAT(all_of(with(1, MotorState::Winds)), HasSubstr("! the motor of channel 1 winds, but no string"));
    EXPECT_THAT(all_of(with(2, MotorState::Pushes)), HasSubstr("this board has no negative codes"));
    BringupFindings dead_encoder = sound(nominal);
    dead_encoder.encoder_of_string[4] = {.tried = true};
    EXPECT_THAT(all_of(judge_bringup(nominal, dead_encoder)), HasSubstr("! no counter follows string 4"));
    EXPECT_FALSE(judge_bringup(nominal, dead_encoder).geometry);
}

TEST(BringupJudge, TakesScalesThatItMeasuredWhereTheyDiffer) {
    const device::DeviceGeometry nominal = x3r();
    BringupFindings findings = sound(nominal);
    findings.encoder_of_string[1].metres_per_count *= 1.03;  // a ruler's error
    findings.encoder_of_string[6].metres_per_count *= 0.5;
    findings.weight_of_string[6] = {2.0 * nominal.strings[6].newtons_per_code, 0.0, 0.0};
    const BringupResult result = judge_bringup(nominal, findings);
    EXPECT_THAT(all_of(result),
                AllOf(HasSubstr("a count of string 6 is 0.500"), HasSubstr("string 6 pulls 2.00 times")));
    EXPECT_EQ(geometry_of(result).strings[1].metres_per_count, nominal.strings[1].metres_per_count);
    EXPECT_EQ(geometry_of(result).strings[6].metres_per_count, 0.5 * nominal.strings[6].metres_per_count);
    EXPECT_EQ(geometry_of(result).strings[6].newtons_per_code, 2.0 * nominal.strings[6].newtons_per_code);
}

TEST(BringupJudge, NarrowsTheTensionToWhatTheCodesCanMake) {
    const device::DeviceGeometry nominal = x3r();
    BringupFindings findings = sound(nominal);
    findings.weight_of_string[0] = {0.002, 0.0, 0.0};  // 8.19 N at code 4095
    const BringupResult result = judge_bringup(nominal, findings);
    EXPECT_NEAR(geometry_of(result).maximum_tension, 0.98 * 4095 * 0.002, 1e-9);
    EXPECT_NO_THROW(static_cast<void>(device::parse_device_geometry(device::to_toml(geometry_of(result), ""), "t")));
}

TEST(Refinement, MovesPointsAndScalesALittleAndNothingElse) {
    const device::DeviceGeometry measured = x3r();
    const auto changed = [&](auto change) {
        device::DeviceGeometry refined = measured;
        change(refined);
        return changed_beyond_calibration(measured, refined);
    };
    EXPECT_THAT(changed([](auto& g) {
                    g.strings[1].motor.x += 0.01;
                    g.strings[3].metres_per_count *= 1.02;
                    g.name = "mine";
                }),
                IsEmpty());
    EXPECT_THAT(changed([](auto& g) { g.strings[3].metres_per_count *= -1.0; }),
                HasSubstr("metres_per_count of string 3"));
    EXPECT_THAT(changed([](auto& g) { std::swap(g.strings[3].motor, g.strings[4].motor); }), HasSubstr("string 3"));
    EXPECT_THAT(changed([](auto& g) { g.strings[5].newtons_per_code *= 1.01; }),
                HasSubstr("newtons_per_code of string 5"));
    EXPECT_THAT(changed([](auto& g) { std::swap(g.motor_channels[0], g.motor_channels[1]); }),
                HasSubstr("motor_channel"));
    EXPECT_THAT(changed([](auto& g) { g.maximum_tension += 1.0; }), HasSubstr("tensions"));
}

TEST(RoundTrips, AreJudgedByLossAndByThePeriod) {
    RoundTrips trips;
    trips.times_ns.assign(999, 300'000);
    EXPECT_THAT(judge_round_trips(trips, 1'000'000, 2), IsEmpty());
    EXPECT_EQ(judge_round_trips(trips, 500'000, 2).size(), 1U) << "two of 0.3 ms in 0.5 ms";
    trips.failed = 20;
    EXPECT_FALSE(judge_round_trips(trips, 1'000'000, 2).at(0).must_be_fixed);
    trips.failed = 500;
    EXPECT_TRUE(judge_round_trips(trips, 1'000'000, 2).at(0).must_be_fixed);
    EXPECT_EQ(trips.quantile(0.99), 300'000);
    EXPECT_EQ(RoundTrips().quantile(0.5), 0);
    EXPECT_THAT(histogram_text(trips), HasSubstr("999 ####"));
}

TEST(DeadManKey, PullsFromTheSecondRepeatUntilTheTimeOut) {
    DeadManKey key(kSecond / 10);
    key.update(0, true, false);
    EXPECT_FALSE(key.held()) << "a single press may be a mistake, and its repeat may come late";
    key.update(kSecond / 2, true, false);
    EXPECT_FALSE(key.held()) << "the repeat came later than the time-out";
    key.update(kSecond / 2 + kSecond / 30, true, false);
    EXPECT_TRUE(key.held());
    key.update(kSecond / 2 + kSecond / 30 + kSecond / 10, false, false);
    EXPECT_TRUE(key.held());
    key.update(kSecond / 2 + kSecond / 30 + kSecond / 10 + 1, false, false);
    EXPECT_FALSE(key.held());
    EXPECT_TRUE(key.released());
    key.update(kSecond, true, false);
    key.update(kSecond + 1, true, false);
    EXPECT_FALSE(key.held()) << "once released, a motor does not pull again by itself";
}

TEST(DeadManKey, IsReleasedByAnyOtherKey) {
    DeadManKey key(kSecond);
    key.update(0, true, false);
    key.update(1, true, false);
    ASSERT_TRUE(key.held());
    key.update(2, true, true);
    EXPECT_FALSE(key.held());
    EXPECT_TRUE(key.released());
}

TEST(Corner, IsNamedAsThePersonInFrontSeesIt) {
    device::DeviceGeometry geometry = x3r();
    geometry.strings[0].motor = {-0.08, -0.07, 0.0};
    geometry.strings[1].motor = {0.0, 0.08, 0.08};
    EXPECT_EQ(corner_of(geometry, 0), "left, low");
    EXPECT_EQ(corner_of(geometry, 1), "high, near");
}

}  // namespace
}  // namespace haptic::rt
