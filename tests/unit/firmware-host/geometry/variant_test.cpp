#include <haptic/device/variant.hpp>

#include <gtest/gtest.h>

#include <array>

namespace haptic::device {
namespace {

struct Row {
    Vec3 motor;
    Vec3 grip;
    double rest_length;
    int sign;
};

// The table of firmware-host/README.md, to the micrometre: worked out from the published sizes apart from this code. z
// points toward the person, away from whom the published one does.
constexpr std::array<Row, kStrings> kX3r = {{
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

TEST(Variant, X3rHasTheTabledGeometry) {
    const Variant variant = spidar_g6_x3r();
    for (std::size_t i = 0; i < kStrings; ++i) {
        SCOPED_TRACE(i);
        expect_near(variant.strings[i].motor, kX3r[i].motor);
        expect_near(variant.strings[i].grip, kX3r[i].grip);
        EXPECT_EQ(variant.strings[i].metres_per_count, kX3r[i].sign * 1.66555e-5);
        EXPECT_DOUBLE_EQ(variant.strings[i].newtons_per_digit, 1.0 / (0.365296803653 * 415.0));
        EXPECT_NEAR(variant.rest_length(i), kX3r[i].rest_length, kTabledTo);
    }
}

TEST(Variant, X3rCoordinatesThatCancelAreExactlyZero) {
    for (const StringFacts& string : spidar_g6_x3r().strings) {
        EXPECT_TRUE(string.motor.x == 0.0 || string.motor.z == 0.0);
    }
}

TEST(Variant, X3rHasThePublishedConstants) {
    const Variant variant = spidar_g6_x3r();
    EXPECT_EQ(variant.name, "SpidarG6X3R");
    EXPECT_EQ(variant.board, BoardKind::Sh4);
    EXPECT_EQ(variant.minimum_tension, 0.3);
    EXPECT_EQ(variant.maximum_tension, 20.0);
}

TEST(Variant, EqualTensionLeavesThePublishedNetForce) {
    // Published beside the geometry: 1 N in each string of an X3R at the centre makes (+0.0575, 0, -0.0575) N, z away
    // from the person.
    const Variant variant = spidar_g6_x3r();
    Vec3 sum{0.0, 0.0, 0.0};
    for (const StringFacts& string : variant.strings) {
        sum += glm::normalize(string.motor - string.grip);
    }
    EXPECT_NEAR(sum.x, +0.0575, 5e-5);
    EXPECT_NEAR(sum.y, 0.0, 1e-12);
    EXPECT_NEAR(sum.z, +0.0575, 5e-5);
}

}  // namespace
}  // namespace haptic::device
