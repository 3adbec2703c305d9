#include "process/force_profiles.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "haptic/device/device_geometry_file.hpp"
#include "process/settings.hpp"

namespace haptic::rt {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

TickSettings tick_of(const char* toml) {
    return read_settings(Config::parse(toml, "test.toml")).tick;
}

TEST(ForceProfiles, GrowFromLearningToExpert) {
    const TickSettings learning = tick_of("safety.profile = \"learning\"");
    const TickSettings normal = tick_of("safety.profile = \"normal\"");
    const TickSettings expert = tick_of("safety.profile = \"expert\"");
    EXPECT_LT(learning.limits.force, normal.limits.force);
    EXPECT_LT(normal.limits.force, expert.limits.force);
    EXPECT_LT(learning.limits.torque, normal.limits.torque);
    EXPECT_LT(learning.limits.force_rate, normal.limits.force_rate);
    EXPECT_LT(learning.budget.second, normal.budget.second);
    EXPECT_LT(normal.budget.session, expert.budget.session);
    EXPECT_LT(learning.budget.duration, expert.budget.duration);
    EXPECT_TRUE(learning.walls.on && normal.walls.on && expert.walls.on);
}

TEST(ForceProfiles, LeaveAnEmulatedDeviceAsItIs) {
    const TickSettings none = tick_of("");
    EXPECT_EQ(none.limits.force, WrenchLimits{}.force);
    EXPECT_EQ(none.budget.second, 0.0);
    EXPECT_FALSE(none.walls.on);
}

TEST(ForceProfiles, AreNarrowedButNeverWidenedByTheLimits) {
    EXPECT_EQ(tick_of("safety.profile = \"normal\"\nlimits.force = 2.0").limits.force, 2.0);
    EXPECT_EQ(tick_of("safety.profile = \"learning\"\nlimits.force = 20.0").limits.force, 3.0);
    EXPECT_EQ(tick_of("safety.profile = \"learning\"\nlimits.torque_rate = 1e4").limits.torque_rate, 6.0);
}

TEST(ForceProfiles, NeverExceedWhatTheStringsExert) {
    // With 6 N in a string an X5R exerts 14.6 N along z, less what its minimum tensions take.
    const TickSettings x5r = tick_of(
        "safety.profile = \"expert\"\ndevice.geometry = \"SpidarG6X5R\"\n"
        "[[profile]]\nname = \"unused\"");
    EXPECT_LT(x5r.limits.force, 14.6);
    EXPECT_GT(x5r.limits.force, 13.6);
    EXPECT_LT(x5r.limits.torque, 0.3);
}

TEST(ForceProfiles, CanBeTheUsersOwn) {
    const TickSettings own = tick_of(
        "safety.profile = \"child\"\n[[profile]]\nname = \"child\"\nforce = 1.5\nenergy_per_session = 20.0\n"
        "walls = false\n[[profile]]\nname = \"other\"");
    EXPECT_EQ(own.limits.force, 1.5);
    EXPECT_EQ(own.limits.torque, normal_profile().limits.torque) << "not given: that of normal";
    EXPECT_EQ(own.budget.session, 20.0);
    EXPECT_FALSE(own.walls.on);
}

TEST(ForceProfiles, RefuseUnknownAndAmbiguousNames) {
    EXPECT_THAT([] { tick_of("safety.profile = \"norma\""); },
                ThrowsMessage<ConfigError>(AllOf(HasSubstr("norma"), HasSubstr("learning, normal, expert"))));
    EXPECT_THAT([] { tick_of("[[profile]]\nforce = 1.0"); }, ThrowsMessage<ConfigError>(HasSubstr("name")));
    EXPECT_THAT([] { tick_of("[[profile]]\nname = \"expert\""); },
                ThrowsMessage<ConfigError>(HasSubstr("another profile")));
    EXPECT_THAT([] { tick_of("[[profile]]\nname = \"a\"\nforce = 100.0"); },
                ThrowsMessage<ConfigError>(HasSubstr("force")));
}

TEST(ForceProfiles, PlaceTheWallsInsideTheReachableRegion) {
    for (const char* geometry : {"SpidarG6X3R", "SpidarG6X4", "SpidarG6X5R"}) {
        TickSettings settings;
        settings.geometry = device::built_in_geometry(geometry);
        settings.frames.max_stiffness = 600.0;
        settings.frames.max_rotational_stiffness = 0.12;
        apply_profile(Config{}, normal_profile(), settings);
        ASSERT_TRUE(settings.walls.on);
        // Full force at the region's edge; at most half the passive stiffness.
        EXPECT_GT(settings.walls.force, 0.5);
        EXPECT_LE(settings.walls.force / settings.walls.thickness, 300.0 + 1e-9);
        EXPECT_LE(settings.walls.torque / settings.walls.angular_thickness, 0.06 + 1e-9);
        EXPECT_THAT(describe_limits("normal", settings), HasSubstr("walls from"));
    }
}

TEST(ForceProfiles, HaveNoWallsWhereTheStringsAreNotWrenchClosed) {
    TickSettings settings;
    settings.geometry = device::built_in_geometry("SpidarG6X3F");
    apply_profile(Config{}, normal_profile(), settings);
    EXPECT_FALSE(settings.walls.on);
}

}  // namespace
}  // namespace haptic::rt
