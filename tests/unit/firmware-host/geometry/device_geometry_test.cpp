#include "haptic/device/device_geometry.hpp"

#include <gtest/gtest.h>

#include <array>

namespace haptic::device {
namespace {

struct TabledString {
    Vec3 motor;
    Vec3 grip;
    double rest_length;
    int sign;
};

// Table of firmware-host's documentation, to the micrometre, derived from the published sizes independently of this
// code. z points toward the user; the published z points away.
constexpr std::array<TabledString, kStrings> kX3rStrings = {{
    {{-0.084853, -0.076, 0.0}, {-0.015910, 0.0, +0.015910}, 0.103838, +1},
    {{0.0, -0.076, -0.084853}, {+0.015910, 0.0, -0.015910}, 0.103838, +1},
    {{+0.084853, -0.076, 0.0}, {0.0, -0.0225, 0.0}, 0.100311, -1},
    {{0.0, -0.076, +0.084853}, {0.0, -0.0225, 0.0}, 0.100311, -1},
    {{-0.084853, +0.076, 0.0}, {-0.015910, 0.0, +0.015910}, 0.103838, -1},
    {{0.0, +0.076, -0.084853}, {+0.015910, 0.0, -0.015910}, 0.103838, -1},
    {{+0.084853, +0.076, 0.0}, {0.0, +0.0225, 0.0}, 0.100311, +1},
    {{0.0, +0.076, +0.084853}, {0.0, +0.0225, 0.0}, 0.100311, +1},
}};
constexpr double kTabledTo = 0.6e-6;  // m

void expect_near(const Vec3& a, const Vec3& b) {
    EXPECT_NEAR(a.x, b.x, kTabledTo);
    EXPECT_NEAR(a.y, b.y, kTabledTo);
    EXPECT_NEAR(a.z, b.z, kTabledTo);
}

TEST(DeviceGeometry, X3rHasTheTabledGeometry) {
    const DeviceGeometry geometry = spidar_g6_x3r();
    for (std::size_t i = 0; i < kStrings; ++i) {
        SCOPED_TRACE(i);
        expect_near(geometry.strings[i].motor, kX3rStrings[i].motor);
        expect_near(geometry.strings[i].grip, kX3rStrings[i].grip);
        EXPECT_EQ(geometry.strings[i].metres_per_count, kX3rStrings[i].sign * 1.66555e-5);
        EXPECT_DOUBLE_EQ(geometry.strings[i].newtons_per_code, 1.0 / (0.365296803653 * 415.0));
        EXPECT_NEAR(geometry.rest_length(i), kX3rStrings[i].rest_length, kTabledTo);
    }
}

TEST(DeviceGeometry, X3rCoordinatesThatCancelAreExactlyZero) {
    for (const StringFacts& string : spidar_g6_x3r().strings) {
        EXPECT_TRUE(string.motor.x == 0.0 || string.motor.z == 0.0);
    }
}

TEST(DeviceGeometry, X3rHasThePublishedConstants) {
    const DeviceGeometry geometry = spidar_g6_x3r();
    EXPECT_EQ(geometry.name, "SpidarG6X3R");
    EXPECT_EQ(geometry.board, BoardKind::Sh4);
    EXPECT_EQ(geometry.minimum_tension, 0.3);
    EXPECT_EQ(geometry.maximum_tension, 20.0);
}

TEST(DeviceGeometry, EqualTensionLeavesThePublishedNetForce) {
    // Published with the geometry: 1 N in each string of an X3R at the centre makes (+0.0575, 0, -0.0575) N, z away
    // from the user.
    const DeviceGeometry geometry = spidar_g6_x3r();
    Vec3 sum{0.0, 0.0, 0.0};
    for (const StringFacts& string : geometry.strings) {
        sum += glm::normalize(string.motor - string.grip);
    }
    EXPECT_NEAR(sum.x, +0.0575, 5e-5);
    EXPECT_NEAR(sum.y, 0.0, 1e-12);
    EXPECT_NEAR(sum.z, +0.0575, 5e-5);
}

}  // namespace
}  // namespace haptic::device
