// Which pairs of features are listed: all that come near one another on their paths, as rounds change these, compared
// with the distances of all pairs on the way.
#include "collision/surface_pairs.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "haptic/sim/collisions.hpp"
#include "meeting_surfaces.hpp"

namespace haptic::sim {
namespace {

/// Each once, with all that come near.
void expect_all_near(MeetingSurfaces& meeting, const std::string& when) {
    const std::vector<NamedPair> listed = meeting.listed();
    const std::set<NamedPair> found(listed.begin(), listed.end());
    EXPECT_EQ(found.size(), listed.size()) << when << ": some are listed twice";
    const std::set<NamedPair> near = meeting.nearer_than(meeting.paths().least_gap);
    EXPECT_GT(near.size(), 100U) << when << ": nothing comes near";
    std::size_t missing = 0;
    for (const NamedPair& pair : near) {
        missing += found.count(pair) == 0 ? 1U : 0U;
    }
    EXPECT_EQ(missing, 0U) << when << ", of " << near.size();
}

TEST(SurfacePairs, AreAllThatComeNearOnThePathsThatAreAsked) {
    for (std::uint32_t seed = 1; seed <= 3; ++seed) {
        MeetingSurfaces meeting(seed);
        meeting.search();
        ASSERT_TRUE(meeting.pairs().knows_all());
        EXPECT_EQ(meeting.pairs().meetings().size(), 3U);
        expect_all_near(meeting, "seed " + std::to_string(seed));
    }
}

TEST(SurfacePairs, AreAllThatComeNearAfterEachRound) {
    // Few vertices or many, a little or far: pairs that stay listed, and pairs that are searched again.
    for (const auto& [count, way] : {std::pair<std::size_t, double>(10, 0.0005), {30, 0.003}, {100, 0.02}}) {
        MeetingSurfaces meeting(4);
        meeting.search();
        for (int round = 1; round <= 3; ++round) {
            meeting.move_some(count, way);
            EXPECT_TRUE(meeting.search_again());
            expect_all_near(meeting, std::to_string(count) + " vertices, round " + std::to_string(round));
        }
        EXPECT_FALSE(meeting.search_again()) << "nothing has moved";
    }
}

TEST(SurfacePairs, AreThoseOfANewAttemptWhateverTheLastOneDid) {
    MeetingSurfaces meeting(5);
    meeting.search();
    const std::vector<NamedPair> first = meeting.listed();
    meeting.move_some(100, 0.02);
    ASSERT_TRUE(meeting.search_again());
    EXPECT_NE(meeting.listed(), first);
    meeting.search();
    EXPECT_EQ(meeting.listed(), first);
}

TEST(SurfacePairs, AreTheSameWithAnyNumberOfThreadsAndLanes) {
    const auto listed = [](int threads, std::size_t lanes) {
        MeetingSurfaces meeting(6, false, threads, lanes);
        meeting.search();
        meeting.move_some(50, 0.005);
        EXPECT_TRUE(meeting.search_again());
        return meeting.listed();
    };
    const std::vector<NamedPair> expected = listed(1, 1);
    for (const int threads : {1, 4}) {
        for (const std::size_t lanes : ParticleCollisions::usable_lanes()) {
            EXPECT_EQ(listed(threads, lanes), expected) << threads << " threads, " << lanes << " lanes";
        }
    }
}

}  // namespace
}  // namespace haptic::sim
