#include "haptic/sim/closest_point.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "contact/oracle.hpp"

namespace {

using haptic::Vec3;
using haptic::sim::closest_point_on_triangle;
using haptic::sim::ClosestPoint;
using haptic::sim::Feature;
using haptic::sim::TriangleCorners;
using haptic::sim::oracle::Random;

constexpr TriangleCorners kTriangle{{0, 0, 0}, {4, 0, 0}, {0, 0, 4}};

struct Region {
    Vec3 from;
    Feature feature;
    int index;
    Vec3 nearest;
};

TEST(ClosestPoint, NamesEachOfTheSevenRegions) {
    for (const Region& r :
         {Region{{1, 3, 1}, Feature::Face, 0, {1, 0, 1}}, Region{{2, 1, -1}, Feature::Edge, 0, {2, 0, 0}},
          Region{{3, 1, 3}, Feature::Edge, 1, {2, 0, 2}}, Region{{-1, 1, 2}, Feature::Edge, 2, {0, 0, 2}},
          Region{{-1, 1, -1}, Feature::Vertex, 0, {0, 0, 0}}, Region{{6, 1, -1}, Feature::Vertex, 1, {4, 0, 0}},
          Region{{-1, 1, 6}, Feature::Vertex, 2, {0, 0, 4}}}) {
        const ClosestPoint c = closest_point_on_triangle(r.from, kTriangle);
        EXPECT_EQ(c.feature, r.feature);
        EXPECT_EQ(c.index, r.index);
        EXPECT_NEAR(glm::length(c.point - r.nearest), 0.0, 1e-14);
        EXPECT_NEAR(glm::length(blend(kTriangle, c.weights) - r.nearest), 0.0, 1e-14);
        EXPECT_NEAR(c.weights.x + c.weights.y + c.weights.z, 1.0, 1e-15);
    }
}

TEST(ClosestPoint, AgreesWithBruteForceOnRandomTriangles) {
    Random random(1);
    for (int k = 0; k < 20000; ++k) {
        const TriangleCorners t{random.in_cube(1), random.in_cube(1), random.in_cube(1)};
        const Vec3 p = random.in_cube(2);
        const ClosestPoint c = closest_point_on_triangle(p, t);
        const double d = std::sqrt(c.squared_distance);
        ASSERT_NEAR(d, haptic::sim::oracle::distance(p, {t.a, t.b, t.c}), 1e-12) << k;
        ASSERT_NEAR(glm::length(p - c.point), d, 1e-14) << k;
        ASSERT_NEAR(glm::length(blend(t, c.weights) - c.point), 0.0, 1e-14) << k;
        ASSERT_GE(std::min({c.weights.x, c.weights.y, c.weights.z}), 0.0) << k;
    }
}

TEST(ClosestPoint, StaysWithinRoundingOnNeedles) {
    // Heights down to zero: the book's region tests lose all digits here.
    Random random(2);
    for (int k = 0; k < 20000; ++k) {
        const double height = std::pow(10.0, -random.uniform(0.0, 18.0));
        const Vec3 a = random.in_cube(1);
        const Vec3 e = random.direction();
        const TriangleCorners t{a, a + e, a + e * random.uniform(-0.5, 1.5) + random.direction() * height};
        const Vec3 p = a + random.in_cube(1);
        const double d = std::sqrt(closest_point_on_triangle(p, t).squared_distance);
        const double truth = haptic::sim::oracle::distance(p, {t.a, t.b, t.c});
        ASSERT_NEAR(d, truth, 1e-12 / std::max(truth, 1e-3)) << k << " height " << height;
    }
}

TEST(ClosestPoint, IsFiniteOnPointsAndLinesAndAtTheTriangleItself) {
    const Vec3 p(1, 2, 3);
    const Vec3 q(0, 0, 1);
    for (const TriangleCorners& t : {TriangleCorners{q, q, q}, TriangleCorners{q, q, p}, TriangleCorners{q, p, q},
                                     TriangleCorners{p, p, p}, TriangleCorners{p, q, q}}) {
        for (const Vec3& from : {p, q, Vec3(0.5, 1, 2), Vec3(-7, 3, 1)}) {
            const ClosestPoint c = closest_point_on_triangle(from, t);
            EXPECT_NEAR(std::sqrt(c.squared_distance), haptic::sim::oracle::distance(from, {t.a, t.b, t.c}), 1e-12);
            EXPECT_NE(c.feature, Feature::Face);
        }
    }
}

TEST(ClosestPoint, DoesNotDependOnTheSide) {
    const ClosestPoint above = closest_point_on_triangle({1, 3, 1}, kTriangle);
    const ClosestPoint below = closest_point_on_triangle({1, -3, 1}, kTriangle);
    EXPECT_EQ(above.point, below.point);
    const ClosestPoint reversed = closest_point_on_triangle({1, 3, 1}, {kTriangle.a, kTriangle.c, kTriangle.b});
    EXPECT_NEAR(glm::length(above.point - reversed.point), 0.0, 1e-15);
}

}  // namespace
