#include "process/arm_switch.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

namespace haptic::rt {
namespace {

constexpr std::int64_t kMs = 1'000'000;

/// Time (ms) at which a button that is read every 1 ms arms, by the bits of its state in spans of 100 ms; -1: never.
std::int64_t arms_at(const std::vector<bool>& spans) {
    HeldButton button;
    for (std::int64_t ms = 0; ms < static_cast<std::int64_t>(100 * spans.size()); ++ms) {
        if (button.update(spans[static_cast<std::size_t>(ms / 100)], ms * kMs)) {
            return ms;
        }
    }
    return -1;
}

std::vector<bool> spans(int released, int held) {
    std::vector<bool> result(static_cast<std::size_t>(released), false);
    result.resize(static_cast<std::size_t>(released + held), true);
    return result;
}

TEST(HeldButton, ArmsAfterASecondOfHolding) {
    // Released for 300 ms; the hold begins with the last reading of the released button at the earliest.
    EXPECT_NEAR(static_cast<double>(arms_at(spans(3, 20))), 1300.0, 1.0);
    EXPECT_EQ(arms_at(spans(3, 9)), -1);
}

TEST(HeldButton, ArmsNothingIfItWasNeverSeenReleased) {
    EXPECT_EQ(arms_at(spans(0, 100)), -1) << "stuck, taped down, or wired to be closed";
}

TEST(HeldButton, StartsAgainWhenItIsLetGo) {
    std::vector<bool> twice = spans(1, 8);
    const std::vector<bool> again = spans(1, 9);
    twice.insert(twice.end(), again.begin(), again.end());
    EXPECT_EQ(arms_at(twice), -1);
}

TEST(HeldButton, CountsOnlyTheTimeInWhichItWasRead) {
    HeldButton button;
    EXPECT_FALSE(button.update(false, 0));
    EXPECT_FALSE(button.update(true, kMs));
    // The process stood still for two seconds: nobody knows whether the button was held meanwhile.
    EXPECT_FALSE(button.update(true, 2001 * kMs));
    for (std::int64_t ms = 2002; ms < 3001; ++ms) {
        ASSERT_FALSE(button.update(true, ms * kMs)) << ms;
    }
    EXPECT_TRUE(button.update(true, 3001 * kMs));
}

TEST(ArmSwitch, CountsAnActOnlyWhileItIsAwaited) {
    ArmSwitch person;
    EXPECT_FALSE(person.press(ArmedBy::Key)) << "typed ahead";
    person.await();
    EXPECT_TRUE(person.awaited());
    EXPECT_FALSE(person.pressed()) << "what came before counts for nothing";
    EXPECT_TRUE(person.press(ArmedBy::Command));
    EXPECT_FALSE(person.press(ArmedBy::Key)) << "the first act has armed";
    EXPECT_TRUE(person.pressed());
    EXPECT_EQ(person.by(), ArmedBy::Command);
    person.give_up();
    EXPECT_TRUE(person.pressed()) << "an act that was taken stays";
    // The next loop awaits an act of its own.
    person.await();
    EXPECT_FALSE(person.pressed());
    person.give_up();
    EXPECT_FALSE(person.press(ArmedBy::Button)) << "the loop has ended";
}

}  // namespace
}  // namespace haptic::rt
