// Where a sphere comes to lie on a surface.
#include "scene/relief.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace haptic::sim {
namespace {

constexpr double kRadius = 0.1;
// Of each cell of r / 8 one point is known, at most sqrt(2) r / 8 from any point of the cell: a sphere is too low by at
// most r - sqrt(r^2 - 2 (r / 8)^2) on a plane.
constexpr double kSampling = 0.016 * kRadius;
// By that distance itself where it touches at 45 degrees.
constexpr double kSamplingAtEdge = 0.18 * kRadius;

struct Surface {
    std::vector<Vec3> vertices;
    std::vector<Triangle> triangles;
    [[nodiscard]] Relief relief() const { return {vertices, triangles, kRadius}; }
};

Surface square(double half, double height) {
    return {{{-half, height, -half}, {half, height, -half}, {half, height, half}, {-half, height, half}},
            {{0, 1, 2}, {0, 2, 3}}};
}

/// A flat washer about the y axis.
Surface washer(double inner, double outer) {
    Surface surface;
    constexpr std::uint32_t n = 48;
    for (std::uint32_t i = 0; i < n; ++i) {
        const double a = 2.0 * std::numbers::pi * i / n;
        surface.vertices.emplace_back(inner * std::cos(a), 0.0, inner * std::sin(a));
        surface.vertices.emplace_back(outer * std::cos(a), 0.0, outer * std::sin(a));
        const std::uint32_t next = 2 * ((i + 1) % n);
        surface.triangles.push_back({2 * i, 2 * i + 1, next});
        surface.triangles.push_back({2 * i + 1, next + 1, next});
    }
    return surface;
}

TEST(ReliefTest, ASphereLiesOnAPlaneByItsRadius) {
    const Relief relief = square(1.0, 3.0).relief();
    for (const auto& [x, z] : std::array<std::pair<double, double>, 3>{{{0.0, 0.0}, {0.13, -0.4}, {0.9, 0.9}}}) {
        EXPECT_NEAR(relief.rest_height(x, z), 3.0 + kRadius, kSampling);
    }
}

TEST(ReliefTest, ASphereRollsOverAnEdgeAndThenFalls) {
    const Relief relief = square(1.0, 0.0).relief();
    // Half a radius beyond the edge it touches the edge: y^2 + (r / 2)^2 = r^2.
    EXPECT_NEAR(relief.rest_height(1.0 + 0.5 * kRadius, 0.0), std::sqrt(0.75) * kRadius, kSamplingAtEdge);
    EXPECT_EQ(relief.rest_height(1.0 + 1.01 * kRadius, 0.0), -std::numeric_limits<double>::infinity());
}

TEST(ReliefTest, TheBestSpotOfAPlaneIsItsMiddle) {
    const Vec3 spot = square(1.0, 0.0).relief().best_spot();
    EXPECT_NEAR(spot.x, 0.0, kRadius);
    EXPECT_NEAR(spot.y, kRadius, kSampling);
    EXPECT_NEAR(spot.z, 0.0, kRadius);
}

TEST(ReliefTest, TheBestSpotOfAWasherIsOnItAndNotInItsHole) {
    const Vec3 spot = washer(0.5, 0.8).relief().best_spot();
    const double distance = std::sqrt(spot.x * spot.x + spot.z * spot.z);
    EXPECT_GT(distance, 0.5);
    EXPECT_LT(distance, 0.8);
    EXPECT_NEAR(spot.y, kRadius, kSampling);
}

TEST(ReliefTest, TheBestSpotOfASlopeWithAShelfIsTheShelf) {
    // A slope of 45 degrees on both sides of the middle, and a shelf at one end.
    const Surface surface{
        {{-1.0, 0.0, -1.0}, {-1.0, 0.0, 1.0}, {0.6, 1.6, -1.0}, {0.6, 1.6, 1.0}, {1.0, 1.6, -1.0}, {1.0, 1.6, 1.0}},
        {{0, 1, 2}, {1, 3, 2}, {2, 3, 4}, {3, 5, 4}}};
    EXPECT_GT(surface.relief().best_spot().x, 0.6);
}

}  // namespace
}  // namespace haptic::sim
