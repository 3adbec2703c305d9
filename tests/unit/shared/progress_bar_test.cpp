#include "program/progress_bar.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "haptic/types.hpp"

namespace haptic {
namespace {

constexpr std::int64_t kSecond = kNanosecondsPerSecond;

TEST(ProgressBar, SaysWhatIsDoneAndHowMuchTimeIsLeft) {
    EXPECT_EQ(progress_line("running fish", 0.4, 8 * kSecond),
              "running fish [############------------------]  40 %, 12 s left");
    EXPECT_EQ(progress_line("running fish", 0.05, 60 * kSecond),
              "running fish [#-----------------------------]   5 %, 19 min left");
    EXPECT_EQ(progress_line("running fish", 0.5, 9000 * kSecond),
              "running fish [###############---------------]  50 %, 2.5 h left");
}

TEST(ProgressBar, EstimatesNothingFromTooLittle) {
    EXPECT_EQ(progress_line("x", 0.001, kSecond), "x [" + std::string(30, '-') + "]   0 %");
}

TEST(ProgressBar, StaysWithinItsRange) {
    EXPECT_EQ(progress_line("x", 1.5, kSecond), "x [" + std::string(30, '#') + "] 100 %, 0 s left");
    EXPECT_EQ(progress_line("x", -1.0, kSecond), "x [" + std::string(30, '-') + "]   0 %");
}

}  // namespace
}  // namespace haptic
