// On random motions our detection misses, delays and invents no contact, and the thesis' method misses about as many as
// its incompleteness predicts, according to an oracle that is tested here as well.
#include "reproduce/ccd_misses.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <iostream>
#include <sstream>
#include <string>

#include "contact/oracle.hpp"
#include "reproduce/touch_oracle.hpp"

namespace {

using haptic::Vec3;
using haptic::sim::oracle::Motion;
using haptic::sim::oracle::Query;
using haptic::sim::oracle::Random;
using haptic::sim::reproduce::CcdMisses;
using haptic::sim::reproduce::first_time_within;
using haptic::sim::reproduce::LinearTriangle;
using haptic::sim::reproduce::OracleTouch;
using haptic::sim::reproduce::Verdict;

TEST(TouchOracle, TimesFaceEdgeAndCornerExactly) {
    const LinearTriangle face{{Vec3{-4, 5, -4}, {4, 5, -4}, {0, 5, 6}}, {Vec3{-4, -5, -4}, {4, -5, -4}, {0, -5, 6}}};
    EXPECT_NEAR(first_time_within(Vec3(0.0), 1.0, face).time, 0.4, 1e-10);
    const LinearTriangle edge{{Vec3{5, 0, -3}, {5, 0, 3}, {9, 0, 0}}, {Vec3{-5, 0, -3}, {-5, 0, 3}, {-1, 0, 0}}};
    EXPECT_NEAR(first_time_within(Vec3(0.0), 1.0, edge).time, 0.4, 1e-10);
    const LinearTriangle corner{{Vec3{5, 0, 0}, {9, 0, 3}, {9, 0, -3}}, {Vec3{-5, 0, 0}, {-1, 0, 3}, {-1, 0, -3}}};
    EXPECT_NEAR(first_time_within(Vec3(0.0), 1.0, corner).time, 0.4, 1e-10);
    EXPECT_EQ(first_time_within(Vec3(0.0, 0.0, 20.0), 1.0, face).verdict, Verdict::Clear);
    EXPECT_EQ(first_time_within(Vec3(0.0, 4.5, 0.0), 1.0, face).time, 0.0) << "m, within from the start";
}

TEST(TouchOracle, AgreesWithDenseSampling) {
    Random random(8);
    int touching = 0;
    for (int k = 0; k < 1500; ++k) {
        const Query q = haptic::sim::oracle::random_query(random, static_cast<Motion>(k % 5), 1.0);
        const auto sampled = haptic::sim::oracle::sample(q, 100);
        const OracleTouch touch = first_time_within(q.center, q.radius, {q.start, q.end});
        ASSERT_NE(touch.verdict, Verdict::Undecided) << k;
        if (sampled.touches) {
            ++touching;
            ASSERT_EQ(touch.verdict, Verdict::Touches) << k;
            ASSERT_LE(touch.time, sampled.first_time + 1e-9) << k;
        }
        if (touch.verdict == Verdict::Touches) {
            // The oracle found a contact between samples: check it at the oracle's time.
            ASSERT_LE(haptic::sim::oracle::distance(q.center, haptic::sim::oracle::at(q, touch.time)), q.radius) << k;
        }
    }
    EXPECT_GT(touching, 500);
}

double share(std::uint64_t part, std::uint64_t whole) {
    return static_cast<double>(part) / static_cast<double>(whole);
}

TEST(CcdMisses, OursIsCompleteWhereTheThesisMissesAThirdOfTheTrianglesAndATenthOfTheCloths) {
    const auto table = haptic::sim::reproduce::measure_ccd_misses({.triangles = 12000, .frames = 3000, .seed = 1});
    haptic::sim::reproduce::print_ccd_misses(std::cout, table);
    ASSERT_EQ(table.size(), 7u);
    for (const CcdMisses& row : table) {
        const std::string what = row.set + ", " + row.motion;
        RecordProperty("thesis_missed_" + row.motion.substr(0, 4), std::to_string(row.thesis.missed));
        EXPECT_EQ(row.undecided, 0u) << what;
        EXPECT_GT(row.contacts, 100u) << what;
        EXPECT_LT(row.contacts, row.drawn) << what;
        EXPECT_EQ(row.complete.missed, 0u) << what;
        EXPECT_EQ(row.complete.spurious, 0u) << what;
        EXPECT_LE(row.complete.max_delay, 1e-9) << what << ": of the step";
        EXPECT_EQ(row.thesis.spurious, 0u) << what;
        EXPECT_GE(row.thesis.max_delay, 0.9) << what << ": it waits for the centre, or for the end of the step";
        EXPECT_GE(row.algorithm_1, row.thesis.missed) << what;
    }
    for (std::size_t k = 0; k < 3; ++k) {  // other seeds give 0.285 to 0.308
        EXPECT_GT(share(table[k].thesis.missed, table[k].contacts), 0.20) << table[k].motion;
        EXPECT_LT(share(table[k].thesis.missed, table[k].contacts), 0.35) << table[k].motion;
    }
    EXPECT_LT(share(table[3].thesis.missed, table[3].contacts), 0.04) << "slow motions end within the sphere";
    for (const std::size_t k : {4u, 6u}) {  // 0.088 and 0.089
        EXPECT_GT(share(table[k].thesis.missed, table[k].contacts), 0.04) << table[k].motion;
        EXPECT_LT(share(table[k].thesis.missed, table[k].contacts), 0.14) << table[k].motion;
    }
    EXPECT_GT(share(table[5].thesis.missed, table[5].contacts), 0.14) << "edge-on: 0.198";
    EXPECT_LT(share(table[5].thesis.missed, table[5].contacts), 0.30) << "edge-on";
}

TEST(CcdMisses, WritesOneLinePerMotionWithTheFieldsOfTheHeader) {
    const auto table = haptic::sim::reproduce::measure_ccd_misses({.triangles = 20, .frames = 5, .seed = 3});
    std::ostringstream out;
    haptic::sim::reproduce::write_ccd_misses(out, table);
    std::istringstream lines(out.str());
    std::string line;
    std::ptrdiff_t commas = 0;
    std::size_t count = 0;
    for (; std::getline(lines, line); ++count) {
        const auto here = std::count(line.begin(), line.end(), ',');
        commas = count == 0 ? here : commas;
        EXPECT_EQ(here, commas) << line;
    }
    EXPECT_EQ(count, table.size() + 1);
}

}  // namespace
