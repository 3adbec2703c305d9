#include <haptic/device/digits.hpp>

#include <gtest/gtest.h>

#include <limits>

namespace haptic::device {
namespace {

constexpr double kX3r = 1.0 / (0.365296803653 * 415.0);  // N a digit

std::int16_t x3r_digit(double tension_n) {
    return digit_of_tension(tension_n, kX3r);
}

TEST(Digits, MatchThePublishedFigures) {
    EXPECT_EQ(x3r_digit(0.3), 0x2D);
    EXPECT_EQ(x3r_digit(20.0), 0xBD7);
    EXPECT_NEAR(tension_of_digit(1, kX3r), 6.60e-3, 5e-6);
    EXPECT_NEAR(tension_of_digit(kMaximumDigit, kX3r), 27.0, 0.05);
}

TEST(Digits, AreCutNotRounded) {
    EXPECT_EQ(x3r_digit(100.99 * kX3r), 100);
    EXPECT_EQ(x3r_digit(100.01 * kX3r), 100);
    EXPECT_EQ(x3r_digit(99.99 * kX3r), 99);
}

TEST(Digits, TensionOfEachGivesThatDigitAgain) {
    for (std::int16_t digit = 0; digit <= kMaximumDigit; ++digit) {
        EXPECT_EQ(x3r_digit(tension_of_digit(digit, kX3r)), digit);
    }
}

TEST(Digits, AreBoundedForAnyTension) {
    EXPECT_EQ(x3r_digit(0.0), 0);
    EXPECT_EQ(x3r_digit(-1.0), 0);
    EXPECT_EQ(x3r_digit(-1e300), 0);
    EXPECT_EQ(x3r_digit(27.1), kMaximumDigit);
    EXPECT_EQ(x3r_digit(1e300), kMaximumDigit);
    EXPECT_EQ(x3r_digit(std::numeric_limits<double>::infinity()), 0);
    EXPECT_EQ(x3r_digit(-std::numeric_limits<double>::infinity()), 0);
    EXPECT_EQ(x3r_digit(std::numeric_limits<double>::quiet_NaN()), 0);
}

TEST(Digits, OfAMotorThatIsWoundTheOtherWayAreNegative) {
    for (const double tension : {0.0, 0.3, 5.0, 100.0}) {
        EXPECT_EQ(digit_of_tension(tension, -kX3r), -x3r_digit(tension));
        EXPECT_EQ(tension_of_digit(digit_of_tension(tension, -kX3r), -kX3r),
                  tension_of_digit(x3r_digit(tension), kX3r));
    }
    EXPECT_EQ(tension_of_digit(-100, kX3r), 0.0) << "a string cannot push";
}

}  // namespace
}  // namespace haptic::device
