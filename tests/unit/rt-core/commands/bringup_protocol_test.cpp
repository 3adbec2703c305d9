#include "commands/bringup_protocol.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

#include "haptic/device/device_geometry_file.hpp"
#include "process/device_protocol.hpp"

namespace haptic::rt {
namespace {

using testing::HasSubstr;

constexpr std::int64_t kPeriod = 1'000'000;

class BringupProtocolOf : public testing::Test {
  protected:
    void TearDown() override { std::filesystem::remove(file); }

    /// What is measured on a sound X3R.
    [[nodiscard]] BringupProtocol sound() const {
        BringupProtocol protocol;
        protocol.noise.emplace();
        for (std::size_t i = 0; i < kStrings; ++i) {
            const device::StringFacts& string = nominal.strings[i];
            PullOut pull;
            pull.metres = 0.05;
            pull.counts[i] = std::lround(pull.metres / string.metres_per_count);
            protocol.pull_outs[i] = pull;
            MotorPull motor;
            motor.code = 50;
            motor.counts[i] = -pull.counts[i];
            motor.seen = static_cast<int>(i);
            protocol.pulls[i] = motor;
            protocol.weighings[i] = {{100.0, 100.0 * string.newtons_per_code}};
            protocol.weighed_with[i] = "spring balance";
        }
        protocol.round_trips = RoundTrips{std::vector<std::int64_t>(100, 200'000), 0};
        protocol.power = {{"Loose at once?", true, true, "the switch fails", true}};
        protocol.power_done = true;
        return protocol;
    }
    [[nodiscard]] BringupSummary summary(const BringupProtocol& protocol) const {
        return summary_of(protocol, nominal, kPeriod, 2);
    }
    [[nodiscard]] BringupProtocol resumed(BringupProtocol protocol) const {
        drop_what_must_be_fixed(protocol, nominal, kPeriod, 2);
        return protocol;
    }

    device::DeviceGeometry nominal = device::built_in_geometry("SpidarG6X3R");
    std::filesystem::path file =
        std::filesystem::temp_directory_path() / ("bringup-" + std::to_string(getpid()) + ".json");
};

TEST_F(BringupProtocolOf, ASoundDeviceCanBeSignedAndLosesNothingWhenItIsResumed) {
    EXPECT_TRUE(summary(sound()).can_be_signed()) << deviations_text(summary(sound()).deviations);
    EXPECT_TRUE(summary(resumed(sound())).can_be_signed());
}

TEST_F(BringupProtocolOf, AnythingThatIsMissingCannotBeSigned) {
    const auto without = [&](auto remove) {
        BringupProtocol protocol = sound();
        remove(protocol);
        return summary(protocol).can_be_signed();
    };
    EXPECT_FALSE(without([](auto& p) { p.noise.reset(); }));
    EXPECT_FALSE(without([](auto& p) { p.pull_outs[3].reset(); }));
    EXPECT_FALSE(without([](auto& p) { p.pulls[5].reset(); }));
    EXPECT_FALSE(without([](auto& p) { p.weighings[7].clear(); }));
    EXPECT_FALSE(without([](auto& p) { p.round_trips.reset(); }));
    EXPECT_FALSE(without([](auto& p) { p.power_done = false; }));
}

TEST_F(BringupProtocolOf, WhatMustBeFixedIsMeasuredAgainWhenItIsResumed) {
    BringupProtocol protocol = sound();
    protocol.noise = {0, 0, 9, 0, 0, 0, 0, 0};
    protocol.pull_outs[1] = PullOut{0.05, {}};                     // no counter followed
    protocol.pull_outs[3] = protocol.pull_outs[2];                 // the same counter twice
    protocol.pulls[4] = MotorPull{50, {}, -1};                     // a dead motor
    protocol.pulls[6] = protocol.pulls[5];                         // the same string twice
    protocol.round_trips = RoundTrips{{200'000}, 50};              // most answers lost
    protocol.power = {{"Loose at once?", false, true, "", true}};  // it was not
    EXPECT_FALSE(summary(protocol).can_be_signed());
    const BringupProtocol left = resumed(protocol);
    EXPECT_FALSE(left.noise);
    EXPECT_FALSE(left.pull_outs[1]);
    EXPECT_FALSE(left.pull_outs[2]);
    EXPECT_FALSE(left.pull_outs[3]);
    EXPECT_TRUE(left.pull_outs[0]);
    EXPECT_FALSE(left.pulls[4]);
    EXPECT_FALSE(left.pulls[5]);
    EXPECT_FALSE(left.pulls[6]);
    EXPECT_TRUE(left.pulls[7]);
    EXPECT_FALSE(left.round_trips);
    EXPECT_FALSE(left.power_done);
}

TEST_F(BringupProtocolOf, AFileReadsBackAsItWasWritten) {
    BringupProtocol protocol = sound();
    protocol.device = "a device";
    protocol.finished = true;
    protocol.skipped = {"nothing"};
    save(protocol, file, {});
    const BringupProtocol read = load_bringup(file);
    EXPECT_EQ(read.device, "a device");
    EXPECT_EQ(read.noise, protocol.noise);
    for (std::size_t i = 0; i < kStrings; ++i) {
        ASSERT_TRUE(read.pull_outs[i] && read.pulls[i]);
        EXPECT_EQ(read.weighings[i].size(), 1U);
    }
    EXPECT_TRUE(summary(read).can_be_signed());
    EXPECT_FALSE(read_protocol(file, nominal).holds()) << "nobody has signed it";
    protocol.person = "Ada";
    protocol.geometry_fingerprint = fingerprint(nominal);
    save(protocol, file, {});
    EXPECT_TRUE(read_protocol(file, nominal).holds());
}

TEST_F(BringupProtocolOf, AFileThatIsNoneIsRefusedWithAWayOut) {
    std::ofstream(file) << "{\"protocol\": 1}";
    try {
        static_cast<void>(load_bringup(file));
        FAIL() << "taken";
    } catch (const std::runtime_error& error) {
        EXPECT_THAT(error.what(), HasSubstr("move it away to start a new one"));
    }
}

}  // namespace
}  // namespace haptic::rt
