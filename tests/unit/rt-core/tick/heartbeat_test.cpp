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

TEST(SilenceJudge, CallsALoopDeadAfterSoManyLooksThatSawNothingNew) {
    SilenceJudge judge;
    for (std::uint64_t beat = 1; beat < 100; ++beat) {
        ASSERT_FALSE(judge.dead(beat, false));
    }
    for (int look = 1; look <= SilenceJudge::kLooks; ++look) {
        EXPECT_EQ(judge.dead(99, false), look == SilenceJudge::kLooks);
    }
}

TEST(SilenceJudge, BeginsAnewWithEachBeat) {
    SilenceJudge judge;
    for (int round = 1; round < 50; ++round) {
        for (int look = 0; look < SilenceJudge::kLooks; ++look) {
            ASSERT_FALSE(judge.dead(static_cast<std::uint64_t>(round), false));
        }
    }
}

TEST(SilenceJudge, LearnsNothingFromALookThatCameLateItself) {
    // The process was stopped for an hour in the middle of a silence that was nearly one look too long.
    SilenceJudge judge;
    EXPECT_FALSE(judge.dead(7, false));
    for (int look = 1; look < SilenceJudge::kLooks; ++look) {
        EXPECT_FALSE(judge.dead(7, false));
    }
    EXPECT_FALSE(judge.dead(7, true));
    EXPECT_FALSE(judge.dead(8, false)) << "and the loop goes on too";
    // But a loop that was dead before and stays so is dead.
    for (int look = 1; look < SilenceJudge::kLooks; ++look) {
        EXPECT_FALSE(judge.dead(8, false));
        EXPECT_FALSE(judge.dead(8, true));
    }
    EXPECT_TRUE(judge.dead(8, false));
}

TEST(SilenceJudge, ExpectsNothingWhileNoLoopRuns) {
    SilenceJudge judge;
    for (int look = 0; look < 100; ++look) {
        ASSERT_FALSE(judge.dead(0, false));
    }
}

TEST(RecordOwner, GivesTheRecordsAwayOnlyWhileTheyAreLentAndOnlyOnce) {
    RecordOwner owner;
    EXPECT_FALSE(owner.take()) << "the tick is at work";
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
