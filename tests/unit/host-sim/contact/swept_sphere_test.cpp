#include "contact/swept_sphere.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "contact/oracle.hpp"

namespace {

using haptic::Vec3;
using haptic::sim::SphereHit;
using haptic::sim::sweep_sphere;
using haptic::sim::TriangleCorners;
using haptic::sim::oracle::Query;
using haptic::sim::oracle::Random;

/// The sphere's move as the opposite move of the triangle, for the sampling oracle.
Query as_query(const Vec3& from, const Vec3& move, const TriangleCorners& t, double radius) {
    Query q;
    q.center = from;
    q.radius = radius;
    q.start = {t.a, t.b, t.c};
    q.end = {t.a - move, t.b - move, t.c - move};
    return q;
}

TEST(SweptSphere, MissesNothingAndInventsNothingOnRandomMoves) {
    Random random(4);
    int hits = 0;
    for (int k = 0; k < 6000; ++k) {
        const TriangleCorners t{random.in_cube(1.5), random.in_cube(1.5), random.in_cube(1.5)};
        const Vec3 from = random.direction() * random.uniform(1.0, 5.0);
        const Vec3 move = random.in_cube(6.0) - from * random.uniform(0.0, 1.0);
        const double radius = random.uniform(0.01, 0.8);
        const double distance = haptic::sim::oracle::distance(from, {t.a, t.b, t.c});
        if (distance <= radius) {
            continue;
        }
        const SphereHit hit = sweep_sphere(from, move, radius, distance, t);
        const auto truth = haptic::sim::oracle::sample(as_query(from, move, t, radius), 100);
        if (truth.touches && truth.min_distance < radius * (1.0 - 1e-9)) {
            ++hits;
            ASSERT_TRUE(hit.hits) << k;
            ASSERT_LE(hit.fraction, truth.first_time + 1e-9) << k;
        }
        if (hit.hits) {
            const double there = haptic::sim::oracle::distance(from + move * hit.fraction, {t.a, t.b, t.c});
            ASSERT_NEAR(there, radius, 1e-9) << k;
        }
    }
    EXPECT_GT(hits, 300);
}

TEST(SweptSphere, SlidesAlongAFaceItIsClearOf) {
    const TriangleCorners floor{{-9, 0, -9}, {-9, 0, 9}, {9, 0, 0}};
    EXPECT_FALSE(sweep_sphere({0, 1, 0}, {3, 0, 0}, 0.999, 1.0, floor).hits);
}

TEST(SweptSphere, HoldsASphereThatIsInsideTheRadiusOnlyAgainstComingNearer) {
    const TriangleCorners floor{{-9, 0, -9}, {-9, 0, 9}, {9, 0, 0}};
    EXPECT_FALSE(sweep_sphere({0, 0.5, 0}, {0, 1, 0}, 1.0, 0.5, floor).hits);
    const SphereHit down = sweep_sphere({0, 0.5, 0}, {0, -0.1, 0}, 1.0, 0.5, floor);
    EXPECT_TRUE(down.hits);
    EXPECT_EQ(down.fraction, 0.0);
    const SphereHit below = sweep_sphere({0, -0.5, 0}, {0, 0.1, 0}, 1.0, 0.5, floor);
    EXPECT_TRUE(below.hits) << "the side is where the centre is, not where the normal points";
}

}  // namespace
