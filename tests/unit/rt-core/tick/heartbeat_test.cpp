#include "tick/heartbeat.hpp"

#include <gtest/gtest.h>

namespace haptic::rt {
namespace {

TEST(Heartbeat, BeatsOnlyWhileALoopRuns) {
    Heartbeat heart;
    heart.beat();
    EXPECT_EQ(heart.beats(), 0u);
    heart.begin();
    const std::uint64_t before = heart.beats();
    EXPECT_NE(before, 0u);
    heart.beat();
    EXPECT_NE(heart.beats(), before);
    heart.end();
    EXPECT_EQ(heart.beats(), 0u);
}

TEST(StallDetector, ReportsAStallAfterEnoughChecksWithoutANewBeat) {
    StallDetector detector;
    for (std::uint64_t beat = 1; beat < 100; ++beat) {
        ASSERT_FALSE(detector.stalled(beat, false));
    }
    for (int check = 1; check <= StallDetector::kChecks; ++check) {
        EXPECT_EQ(detector.stalled(99, false), check == StallDetector::kChecks);
    }
}

TEST(StallDetector, RestartsItsCountAtEachBeat) {
    StallDetector detector;
    for (int round = 1; round < 50; ++round) {
        for (int check = 0; check < StallDetector::kChecks; ++check) {
            ASSERT_FALSE(detector.stalled(static_cast<std::uint64_t>(round), false));
        }
    }
}

TEST(StallDetector, IgnoresACheckThatCameLateItself) {
    // The process was stopped for an hour, one check short of a stall.
    StallDetector detector;
    EXPECT_FALSE(detector.stalled(7, false));
    for (int check = 1; check < StallDetector::kChecks; ++check) {
        EXPECT_FALSE(detector.stalled(7, false));
    }
    EXPECT_FALSE(detector.stalled(7, true));
    EXPECT_FALSE(detector.stalled(8, false)) << "and the loop continues too";
    // A loop that was stalled before and stays so is reported.
    for (int check = 1; check < StallDetector::kChecks; ++check) {
        EXPECT_FALSE(detector.stalled(8, false));
        EXPECT_FALSE(detector.stalled(8, true));
    }
    EXPECT_TRUE(detector.stalled(8, false));
}

TEST(StallDetector, ExpectsNoBeatsWhileNoLoopRuns) {
    StallDetector detector;
    for (int check = 0; check < 100; ++check) {
        ASSERT_FALSE(detector.stalled(0, false));
    }
}

TEST(RecordOwner, HandsTheRecordsOverOnlyWhileLentAndOnlyOnce) {
    RecordOwner owner;
    EXPECT_FALSE(owner.take()) << "the tick owns them";
    owner.lend();
    EXPECT_TRUE(owner.reclaim());
    EXPECT_FALSE(owner.take());
    owner.lend();
    EXPECT_TRUE(owner.take());
    EXPECT_FALSE(owner.take());
    EXPECT_FALSE(owner.reclaim()) << "too late";
}

}  // namespace
}  // namespace haptic::rt
