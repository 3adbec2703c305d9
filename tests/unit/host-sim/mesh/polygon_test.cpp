#include "mesh/polygon.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <random>
#include <vector>

namespace haptic::sim::detail {
namespace {

Vec3 twice_area(const std::vector<Vec3>& corners) {
    Vec3 sum(0.0);
    for (std::size_t i = 0; i < corners.size(); ++i) {
        sum += glm::cross(corners[i], corners[(i + 1) % corners.size()]);
    }
    return sum;
}

/// Triangles with the polygon's winding whose areas sum to the polygon's area neither overlap nor leave gaps.
void expect_cut(const std::vector<Vec3>& corners) {
    const std::vector<Triangle> triangles = cut_polygon(corners);
    ASSERT_EQ(triangles.size(), corners.size() - 2);
    const Vec3 whole = twice_area(corners);
    double sum = 0.0;
    for (const auto& [a, b, c] : triangles) {
        const Vec3 part = glm::cross(corners[b] - corners[a], corners[c] - corners[a]);
        EXPECT_GE(glm::dot(part, whole), 0.0);
        sum += glm::length(part);
    }
    EXPECT_NEAR(sum, glm::length(whole), 1e-12 * glm::length(whole));
}

TEST(Polygon, SplitsAnyShape) {
    expect_cut({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}});
    expect_cut({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}});
    expect_cut({{0, 0, 0}, {3, 0, 0}, {0.5, 0.5, 0}, {0, 3, 0}});                    // an arrow
    expect_cut({{0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {1, 1, 0}, {1, 2, 0}, {0, 2, 0}});  // an L
    expect_cut({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {2, 1, 0}, {1, 1, 0}, {0, 1, 0}});  // corners on sides
    expect_cut({{0, 0, 0},
                {4, 0, 0},
                {4, 4, 0},
                {0, 4, 0},
                {0, 0, 0},
                {1, 1, 0},
                {1, 3, 0},  // a hole with a
                {3, 3, 0},
                {3, 1, 0},
                {1, 1, 0}});  // bridge to it
}

TEST(Polygon, SplitsInAnyOrientation) {
    std::mt19937 random(11);
    const auto uniform = [&random] { return static_cast<double>(random()) / 4294967296.0; };
    for (int round = 0; round < 300; ++round) {
        // Star-shaped about the origin, in a plane spanned by two directions.
        const double angle = 6.0 * uniform();
        const Vec3 u(std::cos(angle), 0.3, std::sin(angle));
        const Vec3 v = glm::cross(u, Vec3(uniform(), 1.0, uniform()));
        const int n = 3 + static_cast<int>(random() % 30);
        std::vector<Vec3> corners;
        for (int i = 0; i < n; ++i) {
            const double around = (round % 2 == 0 ? 2.0 : -2.0) * std::numbers::pi * i / n;
            const double radius = 0.2 + uniform();
            corners.push_back(Vec3(5.0, -2.0, 1.0) + radius * (std::cos(around) * u + std::sin(around) * v));
        }
        const Vec3 origin = corners[0];
        for (Vec3& corner : corners) {
            corner -= origin;
        }
        expect_cut(corners);
    }
}

TEST(Polygon, SplitsAConvexQuadAtItsFirstCorner) {
    const std::vector<Vec3> square{{0, 0, 0}, {0, 0, 1}, {0, 1, 1}, {0, 1, 0}};
    EXPECT_EQ(cut_polygon(square), (std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}}));
}

TEST(Polygon, TerminatesWithoutAnEar) {
    EXPECT_EQ(cut_polygon(std::vector<Vec3>(6, Vec3(1.0))).size(), 4u);                                // a point
    EXPECT_EQ(cut_polygon(std::vector<Vec3>{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}}).size(), 2u);  // a line
    EXPECT_EQ(cut_polygon(std::vector<Vec3>{{0, 0, 0}, {1, 1, 0}, {1, 0, 0}, {0, 1, 0}}).size(), 2u);  // a bow
    EXPECT_EQ(cut_polygon(std::vector<Vec3>{{0, 0, 0}, {NAN, 1, 0}, {1, 0, 0}, {0, 1, 0}}).size(), 2u);
}

}  // namespace
}  // namespace haptic::sim::detail
