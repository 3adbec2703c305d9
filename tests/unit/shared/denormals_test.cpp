#include "haptic/denormals.hpp"

#include <gtest/gtest.h>

namespace haptic {
namespace {

TEST(FlushDenormals, MakesNumbersBelowTheNormalRangeZeroWhileItLives) {
    const volatile double tiny = 4e-308;
    EXPECT_NE(tiny * 0.1, 0.0);
    {
        const FlushDenormals flush;
        EXPECT_EQ(tiny * 0.1, 0.0);
    }
    EXPECT_NE(tiny * 0.1, 0.0);
}

}  // namespace
}  // namespace haptic
