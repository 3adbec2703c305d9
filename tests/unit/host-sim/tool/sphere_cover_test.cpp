#include "tool/sphere_cover.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "generators/revolved.hpp"
#include "haptic/sim/cloth.hpp"
#include "haptic/sim/fish.hpp"
#include "tool/close_gaps.hpp"

namespace haptic::sim {
namespace {

using testing::HasSubstr;

/// Distance of a point from the nearest sphere's surface, negative inside.
double outside(const Vec3& p, const std::vector<Ball>& balls) {
    double min_distance = std::numeric_limits<double>::infinity();
    for (const Ball& ball : balls) {
        min_distance = std::min(min_distance, glm::length(p - ball.centre) - ball.radius);
    }
    return min_distance;
}

/// Greatest distance by brute force over n^2 / 2 points of each triangle.
double sampled_uncovered(const TriangleMesh& mesh, const std::vector<Ball>& balls, int n) {
    double max_distance = 0.0;
    for (const auto& [a, b, c] : mesh.triangles) {
        for (int i = 0; i <= n; ++i) {
            for (int j = 0; i + j <= n; ++j) {
                const double u = static_cast<double>(i) / n;
                const double v = static_cast<double>(j) / n;
                const Vec3 p = (1.0 - u - v) * mesh.vertices[a] + u * mesh.vertices[b] + v * mesh.vertices[c];
                max_distance = std::max(max_distance, outside(p, balls));
            }
        }
    }
    return max_distance;
}

/// Greatest depth of a surface point inside a ball: a lower bound of its protrusion.
double sampled_protrusion(const TriangleMesh& mesh, const Ball& ball, int n) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const auto& [a, b, c] : mesh.triangles) {
        for (int i = 0; i <= n; ++i) {
            for (int j = 0; i + j <= n; ++j) {
                const double u = static_cast<double>(i) / n;
                const double v = static_cast<double>(j) / n;
                const Vec3 p = (1.0 - u - v) * mesh.vertices[a] + u * mesh.vertices[b] + v * mesh.vertices[c];
                nearest = std::min(nearest, glm::length(p - ball.centre));
            }
        }
    }
    return ball.radius - nearest;
}

TEST(SphereCover, BoundsDenseSamplesAndExceedsThemByAtMostOnePercent) {
    const TriangleMesh fish = make_fish_mesh({});
    const std::vector<Ball> balls = cover_with_spheres(fish, {.count = 30});
    ASSERT_EQ(balls.size(), 30u);
    const CoverError error = measure_cover(fish, balls);
    const double uncovered = sampled_uncovered(fish, balls, 12);
    EXPECT_LE(uncovered, error.uncovered);
    EXPECT_LE(error.uncovered, 1.02 * uncovered + 1e-4 * 0.4);  // sampling error; 0.4 m is the fish's diagonal
    double protrusion = 0.0;
    for (const Ball& ball : balls) {
        protrusion = std::max(protrusion, sampled_protrusion(fish, ball, 6));
    }
    EXPECT_LE(protrusion, error.protrusion);
    EXPECT_NEAR(error.uncovered, error.protrusion, 0.15 * error.protrusion);  // balanced, except between samples
}

TEST(SphereCover, KeepsTheRequestedErrorWithFewerSpheresForALargerError) {
    const TriangleMesh fish = make_fish_mesh({});
    std::size_t before = 65;
    for (const double requested : {0.008, 0.012, 0.02}) {
        const std::vector<Ball> balls = cover_with_spheres(fish, {.error = requested});
        const CoverError error = measure_cover(fish, balls);
        EXPECT_LE(error.uncovered, requested);
        EXPECT_LE(error.protrusion, requested);
        EXPECT_LT(balls.size(), before);
        before = balls.size();
    }
}

TEST(SphereCover, OfABallIsThatBall) {
    const TriangleMesh sphere = make_sphere_mesh(0.05);
    const std::vector<Ball> balls = cover_with_spheres(sphere, {.count = 1});
    ASSERT_EQ(balls.size(), 1u);
    // Facets lie up to 0.5 % inside the sphere; the centre is found from about 3,000 samples.
    EXPECT_LT(glm::length(balls[0].centre), 0.01 * 0.05);
    EXPECT_NEAR(balls[0].radius, 0.05, 0.01 * 0.05);
}

TEST(SphereCover, HasTheRequestedRadius) {
    const TriangleMesh fish = make_fish_mesh({});
    const std::vector<Ball> balls = cover_with_spheres(fish, {.count = 40, .radius = 0.012});
    ASSERT_EQ(balls.size(), 40u);
    for (const Ball& ball : balls) {
        EXPECT_EQ(ball.radius, 0.012);
    }
    EXPECT_LE(sampled_uncovered(fish, balls, 4), measure_cover(fish, balls).uncovered);
}

TEST(SphereCover, OfASheetSitsOnItAndLeavesNothingUncovered) {
    const TriangleMesh sheet = make_cloth_mesh({.vertices_per_side = 9, .side = 1.0});
    const std::vector<Ball> balls = cover_with_spheres(sheet, {.count = 16});
    for (const Ball& ball : balls) {
        EXPECT_EQ(ball.centre.y, 0.0);
    }
    EXPECT_LE(sampled_uncovered(sheet, balls, 8), 1e-4 * std::sqrt(2.0));
    // For comparison: a square lattice of 16 has a circumradius of 0.177.
    EXPECT_LT(balls[0].radius, 1.35 * 0.177);
    EXPECT_EQ(measure_cover(sheet, balls).protrusion, balls[0].radius);
}

TEST(SphereCover, ReportsTheErrorThatTheMaximumNumberLeaves) {
    try {
        (void)cover_with_spheres(make_fish_mesh({}), {.max_count = 8, .error = 1e-4});
        FAIL() << "accepted";
    } catch (const std::invalid_argument& error) {
        EXPECT_THAT(error.what(), HasSubstr("more than 8 spheres; with that many, the mesh is up to 0.0"));
    }
    EXPECT_THROW((void)cover_with_spheres(make_fish_mesh({}), {}), std::invalid_argument);
    EXPECT_THROW((void)cover_with_spheres(make_fish_mesh({}), {.count = 65}), std::invalid_argument);
    EXPECT_THROW((void)cover_with_spheres({}, {.count = 1}), std::invalid_argument);
}

// Three balls of radius 1 at the corners of an equilateral triangle of side 3.4: gaps of 1.4.
const std::vector<Ball>& three_balls() {
    static const std::vector<Ball> balls{
        {{0.0, 0.0, 0.0}, 1.0}, {{3.4, 0.0, 0.0}, 1.0}, {{1.7, 1.7 * std::sqrt(3.0), 0.0}, 1.0}};
    return balls;
}

double anywhere(const Vec3& /*p*/) {
    return 1e9;
}

TEST(CloseGaps, MeasuresTheThickestRodThatPassesBetweenNeighbours) {
    EXPECT_NEAR(widest_gap(three_balls(), {{0, 1}}), 1.4, 0.015);
    // The centroid is 3.4 / sqrt(3) from each centre.
    EXPECT_NEAR(widest_gap(three_balls(), {{0, 1}, {0, 2}, {1, 2}}), 2.0 * (3.4 / std::sqrt(3.0) - 1.0), 0.02);
    EXPECT_EQ(widest_gap(three_balls(), {}), 0.0);
}

TEST(CloseGaps, CoversTheNetEvenWhenStretchedByATenth) {
    const std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs{{0, 1}, {0, 2}, {1, 2}};
    std::vector<Ball> closed = close_gaps(three_balls(), pairs, 64, anywhere);
    EXPECT_EQ(closed.size(), 10u);  // one per side leaves a hole in each of four triangles of side 1.7
    for (Ball& ball : closed) {
        ball.centre *= 1.1;
    }
    const std::vector<Ball>& balls = three_balls();
    for (int i = 0; i <= 100; ++i) {
        for (int j = 0; i + j <= 100; ++j) {
            const double u = i / 100.0;
            const double v = j / 100.0;
            const Vec3 p = 1.1 * ((1.0 - u - v) * balls[0].centre + u * balls[1].centre + v * balls[2].centre);
            EXPECT_LE(outside(p, closed), 0.0) << u << ' ' << v;
        }
    }
}

TEST(CloseGaps, InterpolatesRadiiBetweenTwoBallsOfDifferentSize) {
    const std::vector<Ball> two{{{0.0, 0.0, 0.0}, 1.0}, {{9.0, 0.0, 0.0}, 2.0}};
    const std::vector<Ball> closed = close_gaps(two, {{0, 1}}, 64, anywhere);
    ASSERT_GT(closed.size(), 2u);
    for (std::size_t k = 2; k < closed.size(); ++k) {
        EXPECT_NEAR(closed[k].radius, 1.0 + closed[k].centre.x / 9.0, 1e-12);
    }
    EXPECT_EQ(widest_gap(closed, {{0, 1}}), 0.0);
}

TEST(CloseGaps, RespectsTheRadiusLimit) {
    const std::vector<Ball> two{{{0.0, 0.0, 0.0}, 1.0}, {{4.0, 0.0, 0.0}, 1.0}};
    const std::vector<Ball> closed = close_gaps(two, {{0, 1}}, 64, [](const Vec3&) { return 0.3; });
    ASSERT_GT(closed.size(), 4u);
    for (std::size_t k = 2; k < closed.size(); ++k) {
        EXPECT_LE(closed[k].radius, 0.3);
    }
    EXPECT_EQ(widest_gap(closed, {{0, 1}}), 0.0);
    EXPECT_EQ(close_gaps(two, {{0, 1}}, 64, [](const Vec3&) { return -0.1; }).size(), 2u);
}

TEST(CloseGaps, AddsNothingWithoutGapsAndReportsHowManyAreTooMany) {
    const std::vector<Ball> near{{{0.0, 0.0, 0.0}, 1.0}, {{1.5, 0.0, 0.0}, 1.0}};
    EXPECT_EQ(close_gaps(near, {{0, 1}}, 64, anywhere).size(), 2u);
    const std::vector<Ball> far{{{0.0, 0.0, 0.0}, 1.0}, {{200.0, 0.0, 0.0}, 1.0}};
    try {
        (void)close_gaps(far, {{0, 1}}, 64, anywhere);
        FAIL() << "accepted";
    } catch (const std::invalid_argument& error) {
        EXPECT_THAT(error.what(), HasSubstr("needs 113"));  // 112 spacings of 1.79: 0.9 times two radii is 1.8
    }
}

}  // namespace
}  // namespace haptic::sim
