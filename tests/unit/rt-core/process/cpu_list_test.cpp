#include "process/cpu_list.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace haptic::rt {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

TEST(CpuList, ReadsRangesAndSingleProcessorsInAnyOrder) {
    EXPECT_THAT(parse_cpu_list("0-2,5"), ElementsAre(0, 1, 2, 5));
    EXPECT_THAT(parse_cpu_list("7"), ElementsAre(7));
    EXPECT_THAT(parse_cpu_list("5,0-1,1"), ElementsAre(0, 1, 5));
}

TEST(CpuList, IsEmptyForMalformedText) {
    for (const char* const text : {"", "(null)", "3-1", "1,,2", "1-", "-1", "1 2", "99999", "0-99999999999"}) {
        EXPECT_THAT(parse_cpu_list(text), IsEmpty()) << text;
    }
}

TEST(CpuList, ReadsMasksByGroupsOf32) {
    EXPECT_THAT(parse_cpu_mask("5"), ElementsAre(0, 2));
    EXPECT_THAT(parse_cpu_mask("c0,80000001"), ElementsAre(0, 31, 38, 39));
    EXPECT_THAT(parse_cpu_mask("00000000,00000002"), ElementsAre(1));
    for (const char* const text : {"", "0", "x", "1,", ",1", "1,,1", "1ffffffff"}) {
        EXPECT_THAT(parse_cpu_mask(text), IsEmpty()) << text;
    }
}

TEST(CpuList, WritesWhatItReads) {
    for (const char* const text : {"", "0", "0-2,5", "1,3,5-7", "62-63"}) {
        EXPECT_EQ(cpu_list_text(parse_cpu_list(text)), text);
    }
}

TEST(CpuChoice, IsTheLastAllowedProcessorWhereNoneIsIsolated) {
    EXPECT_EQ(choose_cpu({.allowed = {0, 1, 2}, .online = {0, 1, 2, 3}, .isolated = {}}), 2);
    EXPECT_EQ(choose_cpu({.allowed = {}, .online = {0}, .isolated = {}}), 0);
}

TEST(CpuChoice, PrefersTheLastIsolatedProcessorOutsideTheDefaultAffinity) {
    EXPECT_EQ(choose_cpu({.allowed = {0, 3}, .online = {0, 1, 2, 3}, .isolated = {1, 2}}), 2);
    EXPECT_EQ(choose_cpu({.allowed = {0, 1, 2}, .online = {0, 1, 2, 3}, .isolated = {3}}), 3);
}

TEST(CpuChoice, StaysWithinANarrowedAffinity) {
    EXPECT_EQ(choose_cpu({.allowed = {1}, .online = {0, 1, 2, 3}, .isolated = {3}}), 1);
    EXPECT_EQ(choose_cpu({.allowed = {0, 2}, .online = {0, 1, 2, 3}, .isolated = {2, 3}}), 2);
}

TEST(CpuChoice, SkipsAnIsolatedProcessorThatIsOffline) {
    EXPECT_EQ(choose_cpu({.allowed = {0, 1}, .online = {0, 1}, .isolated = {3}}), 1);
}

}  // namespace
}  // namespace haptic::rt
