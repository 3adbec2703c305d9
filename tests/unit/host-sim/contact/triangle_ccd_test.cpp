#include "contact/triangle_ccd.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "contact/oracle.hpp"
#include "contact/verification.hpp"

namespace {

using haptic::Vec3;
using haptic::sim::MovingTriangle;
using haptic::sim::PointPassage;
using haptic::sim::sphere_triangle_ccd;
using haptic::sim::TriangleTouch;
using haptic::sim::oracle::Motion;
using haptic::sim::oracle::Query;
using haptic::sim::oracle::Random;

class AgainstSampling : public testing::TestWithParam<Motion> {};

TEST_P(AgainstSampling, MissesNothingAndInventsNothingAndIsNeverLate) {
    Random random(11 + static_cast<std::uint64_t>(GetParam()));
    int touching = 0;
    int max_iterations = 0;
    for (int k = 0; k < 1500; ++k) {
        Query q = haptic::sim::oracle::random_query(random, GetParam(), 1.0);
        q.radius = k % 3 == 0 ? random.uniform(1e-3, 1.0) : q.radius;
        const auto truth = haptic::sim::oracle::sample(q, 200);
        const TriangleTouch ours = sphere_triangle_ccd(q.center, q.radius, moving(q));
        max_iterations = std::max(max_iterations, ours.iterations);
        if (truth.touches) {
            ++touching;
            ASSERT_TRUE(ours.touches) << "query " << k << ": missed a touch at " << truth.first_time;
            ASSERT_LE(ours.time, truth.first_time + 1e-9) << "query " << k;
            const double there = haptic::sim::oracle::distance(q.center, haptic::sim::oracle::at(q, ours.time));
            ASSERT_LE(there, q.radius * (1.0 + 1e-4)) << "query " << k << ": stops early";
        } else if (ours.touches) {
            ASSERT_LE(truth.min_distance, q.radius * (1.0 + 1e-4)) << "query " << k << ": invented";
        }
    }
    EXPECT_GT(touching, 300);
    EXPECT_LT(touching, 1500);
    RecordProperty("most_iterations", max_iterations);
}

INSTANTIATE_TEST_SUITE_P(Motions, AgainstSampling,
                         testing::Values(Motion::Translating, Motion::Deforming, Motion::Rotating, Motion::Slow,
                                         Motion::EdgeOn, Motion::Sliver));

TEST(SphereTriangleCcd, FindsTheSameTouchesFromMicrometresToKilometres) {
    for (const double scale : {1e-6, 1e-4, 1e-2, 1.0, 1e2, 1e4}) {
        Random reference(5);
        Random scaled(5);
        for (int k = 0; k < 1000; ++k) {
            const auto motion = static_cast<Motion>(k % 5);
            const Query one = haptic::sim::oracle::random_query(reference, motion, 1.0);
            const Query other = haptic::sim::oracle::random_query(scaled, motion, scale);
            const TriangleTouch a = sphere_triangle_ccd(one.center, one.radius, moving(one));
            const TriangleTouch b = sphere_triangle_ccd(other.center, other.radius, moving(other));
            ASSERT_EQ(a.touches, b.touches) << "query " << k << " at scale " << scale;
            ASSERT_NEAR(a.time, b.time, 1e-9) << "query " << k << " at scale " << scale;
        }
    }
}

TEST(SphereTriangleCcd, TimesAFaceThatFallsOntoTheSphereExactly) {
    const MovingTriangle falling{{{-4, 5, -4}, {4, 5, -4}, {0, 5, 6}}, {{-4, -5, -4}, {4, -5, -4}, {0, -5, 6}}};
    const TriangleTouch touch = sphere_triangle_ccd(Vec3(0.0), 1.0, falling);
    ASSERT_TRUE(touch.touches);
    EXPECT_NEAR(touch.time, 0.4, 1e-12);  // from height 5 at 10 per step, to height 1
    EXPECT_EQ(touch.at.feature, haptic::sim::Feature::Face);
    const PointPassage passage = haptic::sim::point_passage(Vec3(0.0), falling);
    ASSERT_TRUE(passage.passes);
    EXPECT_NEAR(passage.time, 0.5, 1e-15);
}

TEST(SphereTriangleCcd, TimesAnEdgeAndACornerThatComeEdgeOnExactly) {
    const MovingTriangle edge{{{5, 0, -3}, {5, 0, 3}, {9, 0, 0}}, {{-5, 0, -3}, {-5, 0, 3}, {-1, 0, 0}}};
    const TriangleTouch on_edge = sphere_triangle_ccd(Vec3(0.0), 1.0, edge);
    ASSERT_TRUE(on_edge.touches);
    EXPECT_NEAR(on_edge.time, 0.4, 1e-12);
    EXPECT_EQ(on_edge.at.feature, haptic::sim::Feature::Edge);
    const MovingTriangle corner{{{5, 0, 0}, {9, 0, 3}, {9, 0, -3}}, {{-5, 0, 0}, {-1, 0, 3}, {-1, 0, -3}}};
    const TriangleTouch on_corner = sphere_triangle_ccd(Vec3(0.0), 1.0, corner);
    ASSERT_TRUE(on_corner.touches);
    EXPECT_NEAR(on_corner.time, 0.4, 1e-12);
    EXPECT_EQ(on_corner.at.feature, haptic::sim::Feature::Vertex);
}

TEST(SphereTriangleCcd, TouchesAtZeroWhatTouchesFromTheStart) {
    const MovingTriangle resting{{{-1, 0.5, -1}, {1, 0.5, -1}, {0, 0.5, 1}},
                                 {{-1, 0.5, -1}, {1, 0.5, -1}, {0, 0.5, 1}}};
    const TriangleTouch touch = sphere_triangle_ccd(Vec3(0.0), 1.0, resting);
    EXPECT_TRUE(touch.touches);
    EXPECT_EQ(touch.time, 0.0);
}

TEST(SphereTriangleCcd, LetsATriangleThatIsReleasedAlreadyGo) {
    MovingTriangle leaving{{{-1, 0.5, -1}, {1, 0.5, -1}, {0, 0.5, 1}}, {{-1, 2, -1}, {1, 2, -1}, {0, 2, 1}}};
    EXPECT_FALSE(sphere_triangle_ccd(Vec3(0.0), 1.0, leaving, 1.0, 0.9).touches);
    std::swap(leaving.start, leaving.end);
    EXPECT_TRUE(sphere_triangle_ccd(Vec3(0.0), 1.0, leaving, 1.0, 0.9).touches);
}

TEST(SphereTriangleCcd, KeepsASphereThatGrazesAFaceForTheWholeStepCheap) {
    // A large face slides past at just over the radius: plain conservative advancement would creep along it.
    const MovingTriangle sliding{{{-9, 1.0001, -9}, {9, 1.0001, -9}, {0, 1.0001, 9}},
                                 {{-6, 1.0001, -9}, {12, 1.0001, -9}, {3, 1.0001, 9}}};
    const TriangleTouch touch = sphere_triangle_ccd(Vec3(0.0), 1.0, sliding);
    EXPECT_FALSE(touch.touches);
    EXPECT_LT(touch.iterations, 4);
}

TEST(SphereTriangleCcd, AnswersForAPointAndForALine) {
    const MovingTriangle point{{{5, 0, 0}, {5, 0, 0}, {5, 0, 0}}, {{-5, 0, 0}, {-5, 0, 0}, {-5, 0, 0}}};
    const TriangleTouch on_point = sphere_triangle_ccd(Vec3(0.0), 1.0, point);
    ASSERT_TRUE(on_point.touches);
    EXPECT_NEAR(on_point.time, 0.4, 1e-12);
    const MovingTriangle line{{{5, -1, 0}, {5, 1, 0}, {5, 3, 0}}, {{-5, -1, 0}, {-5, 1, 0}, {-5, 3, 0}}};
    const TriangleTouch on_line = sphere_triangle_ccd(Vec3(0.0), 1.0, line);
    ASSERT_TRUE(on_line.touches);
    EXPECT_NEAR(on_line.time, 0.4, 1e-12);
}

TEST(PointPassage, FindsATriangleThatSlidesInItsOwnPlaneOverThePoint) {
    const MovingTriangle edge{{{5, 0, -3}, {5, 0, 3}, {9, 0, 0}}, {{-5, 0, -3}, {-5, 0, 3}, {-1, 0, 0}}};
    const PointPassage passage = haptic::sim::point_passage(Vec3(0.0), edge);
    ASSERT_TRUE(passage.passes);
    EXPECT_NEAR(passage.time, 0.5, 1e-9);
}

TEST(PointPassage, AgreesWithTheSignOfTheVolumeOverRandomTranslations) {
    Random random(3);
    int passages = 0;
    for (int k = 0; k < 3000; ++k) {
        const Query q = haptic::sim::oracle::random_query(random, Motion::Translating, 1.0);
        // A translation passes where the line from the point against the travel meets the triangle.
        const Vec3 travel = q.end[0] - q.start[0];
        const Vec3 n = glm::cross(q.start[1] - q.start[0], q.start[2] - q.start[0]);
        const double time = glm::dot(n, q.center - q.start[0]) / glm::dot(n, travel);
        const double off = haptic::sim::oracle::distance(q.center, haptic::sim::oracle::at(q, time));
        const bool expected = time >= 0.0 && time <= 1.0 && off < 1e-9;
        const PointPassage ours = haptic::sim::point_passage(q.center, moving(q));
        ASSERT_EQ(ours.passes, expected) << "query " << k << " time " << time << " off " << off;
        if (expected) {
            ++passages;
            ASSERT_NEAR(ours.time, time, 1e-9) << "query " << k;
        }
    }
    EXPECT_GT(passages, 100);
}

TEST(PointPassage, AgreesWithTheVerificationWhichSharesNoCodeWithIt) {
    Random random(17);
    int passages = 0;
    const std::vector<haptic::sim::Triangle> one{{0, 1, 2}};
    for (int k = 0; k < 30000; ++k) {
        const Query q = haptic::sim::oracle::random_query(random, static_cast<Motion>(k % 4), 1.0);
        const PointPassage ours = haptic::sim::point_passage(q.center, moving(q));
        const std::array<haptic::sim::SurfaceMotion, 1> surfaces{{{q.start, q.end, one}}};
        const std::array<haptic::sim::PathKnot, 2> path{{{0.0, q.center}, {1.0, q.center}}};
        const auto theirs = haptic::sim::find_crossings(surfaces, path);
        ASSERT_EQ(ours.passes, !theirs.empty()) << "query " << k;
        if (ours.passes) {
            ++passages;
            ASSERT_NEAR(ours.time, theirs[0].time, 1e-12) << "query " << k;
            ASSERT_GE(ours.time, sphere_triangle_ccd(q.center, q.radius, moving(q)).time) << "query " << k;
        }
    }
    EXPECT_GT(passages, 2000);
}

}  // namespace
