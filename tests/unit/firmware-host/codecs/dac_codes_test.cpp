#include "haptic/device/dac_codes.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace haptic::device {
namespace {

constexpr double kX3rNewtonsPerCode = 1.0 / (0.365296803653 * 415.0);  // N per code

std::int16_t x3r_dac_code(double tension_n) {
    return dac_code_of_tension(tension_n, kX3rNewtonsPerCode);
}

TEST(DacCodes, MatchThePublishedFigures) {
    EXPECT_EQ(x3r_dac_code(0.3), 0x2D);
    EXPECT_EQ(x3r_dac_code(20.0), 0xBD7);
    EXPECT_NEAR(tension_of_dac_code(1, kX3rNewtonsPerCode), 6.60e-3, 5e-6);
    EXPECT_NEAR(tension_of_dac_code(kMaxDacCode, kX3rNewtonsPerCode), 27.0, 0.05);
}

TEST(DacCodes, AreCutNotRounded) {
    EXPECT_EQ(x3r_dac_code(100.99 * kX3rNewtonsPerCode), 100);
    EXPECT_EQ(x3r_dac_code(100.01 * kX3rNewtonsPerCode), 100);
    EXPECT_EQ(x3r_dac_code(99.99 * kX3rNewtonsPerCode), 99);
}

TEST(DacCodes, TensionOfEachCodeGivesThatCodeAgain) {
    for (std::int16_t dac_code = 0; dac_code <= kMaxDacCode; ++dac_code) {
        EXPECT_EQ(x3r_dac_code(tension_of_dac_code(dac_code, kX3rNewtonsPerCode)), dac_code);
    }
}

TEST(DacCodes, AreBoundedForAnyTension) {
    EXPECT_EQ(x3r_dac_code(0.0), 0);
    EXPECT_EQ(x3r_dac_code(-1.0), 0);
    EXPECT_EQ(x3r_dac_code(-1e300), 0);
    EXPECT_EQ(x3r_dac_code(27.1), kMaxDacCode);
    EXPECT_EQ(x3r_dac_code(1e300), kMaxDacCode);
    EXPECT_EQ(x3r_dac_code(std::numeric_limits<double>::infinity()), 0);
    EXPECT_EQ(x3r_dac_code(-std::numeric_limits<double>::infinity()), 0);
    EXPECT_EQ(x3r_dac_code(std::numeric_limits<double>::quiet_NaN()), 0);
}

TEST(DacCodes, OfAMotorThatIsWoundTheOtherWayAreNegative) {
    for (const double tension : {0.0, 0.3, 5.0, 100.0}) {
        EXPECT_EQ(dac_code_of_tension(tension, -kX3rNewtonsPerCode), -x3r_dac_code(tension));
        EXPECT_EQ(tension_of_dac_code(dac_code_of_tension(tension, -kX3rNewtonsPerCode), -kX3rNewtonsPerCode),
                  tension_of_dac_code(x3r_dac_code(tension), kX3rNewtonsPerCode));
    }
    EXPECT_EQ(tension_of_dac_code(-100, kX3rNewtonsPerCode), 0.0) << "a string cannot push";
}

}  // namespace
}  // namespace haptic::device
