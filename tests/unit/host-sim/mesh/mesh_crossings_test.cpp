// Ten shapes as users bring them: what is said of where they pass through themselves.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "haptic/sim/mesh_check.hpp"

namespace haptic::sim {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr double kTurn = 6.283185307179586;

struct Shape {
    std::vector<Vec3> vertices;
    std::vector<Triangle> triangles;

    Shape& add(const Shape& other, const Vec3& shift = Vec3(0.0)) {
        const auto first = static_cast<std::uint32_t>(vertices.size());
        for (const Vec3& v : other.vertices) {
            vertices.push_back(v + shift);
        }
        for (const auto& [a, b, c] : other.triangles) {
            triangles.push_back({a + first, b + first, c + first});
        }
        return *this;
    }
};

MeshReport report_of_shape(const Shape& shape) {
    return check_mesh(shape.vertices, shape.triangles, {}, "shape").report;
}

/// Grid of rows x columns points, two triangles a cell; `closed_rows`, `closed_columns` join the last to the first.
Shape grid_of(std::uint32_t rows, std::uint32_t columns, bool closed_rows, bool closed_columns,
              const std::function<Vec3(double, double)>& at) {
    Shape shape;
    const std::uint32_t cell_rows = closed_rows ? rows : rows - 1;
    const std::uint32_t cell_columns = closed_columns ? columns : columns - 1;
    for (std::uint32_t i = 0; i < rows; ++i) {
        for (std::uint32_t j = 0; j < columns; ++j) {
            shape.vertices.push_back(at(i / static_cast<double>(cell_rows), j / static_cast<double>(cell_columns)));
        }
    }
    for (std::uint32_t i = 0; i < cell_rows; ++i) {
        for (std::uint32_t j = 0; j < cell_columns; ++j) {
            const auto index = [&](std::uint32_t r, std::uint32_t c) { return (r % rows) * columns + c % columns; };
            shape.triangles.push_back({index(i, j), index(i + 1, j), index(i, j + 1)});
            shape.triangles.push_back({index(i, j + 1), index(i + 1, j), index(i + 1, j + 1)});
        }
    }
    return shape;
}

Shape box_of(const Vec3& half) {
    Shape shape;
    for (unsigned k = 0; k < 8; ++k) {
        shape.vertices.emplace_back((k & 1u) != 0 ? half.x : -half.x, (k & 2u) != 0 ? half.y : -half.y,
                                    (k & 4u) != 0 ? half.z : -half.z);
    }
    shape.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                       {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
    return shape;
}

Shape double_faced(Shape shape) {
    const std::size_t count = shape.triangles.size();
    for (std::size_t t = 0; t < count; ++t) {
        const auto [a, b, c] = shape.triangles[t];
        shape.triangles.push_back({a, c, b});
    }
    return shape;
}

/// Edges that pierce a triangle without a common vertex, by the signs of volumes alone: for shapes in general position.
std::size_t pierced_by_brute_force(const Shape& shape) {
    const auto positive = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
        const std::vector<Vec3>& x = shape.vertices;
        return glm::dot(glm::cross(x[b] - x[a], x[c] - x[a]), x[d] - x[a]) > 0.0;
    };
    std::set<std::array<std::uint32_t, 2>> edges;
    for (const Triangle& t : shape.triangles) {
        for (std::size_t k = 0; k < 3; ++k) {
            edges.insert({std::min(t[k], t[(k + 1) % 3]), std::max(t[k], t[(k + 1) % 3])});
        }
    }
    std::size_t count = 0;
    for (const auto& [p, q] : edges) {
        for (const auto& [a, b, c] : shape.triangles) {
            const bool side = positive(p, q, a, b);
            const bool pierced = positive(a, b, c, p) != positive(a, b, c, q) && positive(p, q, b, c) == side &&
                                 positive(p, q, c, a) == side;
            count += pierced && std::set<std::uint32_t>{p, q, a, b, c}.size() == 5 ? 1U : 0U;
        }
    }
    return count;
}

TEST(MeshCrossings, AThinPlateHasNone) {
    const MeshReport report = report_of_shape(box_of({0.5, 0.0005, 0.5}));
    EXPECT_EQ(report.crossings, 0u);
    EXPECT_TRUE(report.closed);
    EXPECT_THAT(report.warnings, IsEmpty());
}

TEST(MeshCrossings, AClosedBallHasNone) {
    Shape ball = grid_of(9, 20, false, true, [](double u, double v) {
        const double polar = 0.5 * kTurn * (0.05 + 0.9 * u);
        return Vec3(std::sin(polar) * std::cos(kTurn * v), std::cos(polar), std::sin(polar) * std::sin(kTurn * v));
    });
    // Caps of one triangle for each edge of the first and the last ring.
    ball.vertices.emplace_back(0, 1, 0);
    ball.vertices.emplace_back(0, -1, 0);
    for (std::uint32_t j = 0; j < 20; ++j) {
        ball.triangles.push_back({180, j, (j + 1) % 20});
        ball.triangles.push_back({181, 160 + (j + 1) % 20, 160 + j});
    }
    const MeshReport report = report_of_shape(ball);
    EXPECT_EQ(report.crossings, 0u);
    EXPECT_TRUE(report.closed);
    EXPECT_THAT(report.warnings, Not(Contains(HasSubstr("passes through itself"))));
}

TEST(MeshCrossings, AnOpenBowlHasNone) {
    const MeshReport report = report_of_shape(grid_of(8, 16, false, true, [](double u, double v) {
        const double polar = 0.25 * kTurn * (0.1 + 0.9 * u);
        return Vec3(std::sin(polar) * std::cos(kTurn * v), -std::cos(polar), std::sin(polar) * std::sin(kTurn * v));
    }));
    EXPECT_EQ(report.crossings, 0u);
    EXPECT_FALSE(report.closed);
    EXPECT_THAT(report.warnings, Not(Contains(HasSubstr("passes through itself"))));
}

TEST(MeshCrossings, ADoubleFacedSheetHasNone) {
    const auto wave = [](double u, double v) { return Vec3(u, 0.1 * std::sin(kTurn * u) * std::cos(kTurn * v), v); };
    const MeshReport report = report_of_shape(double_faced(grid_of(12, 12, false, false, wave)));
    EXPECT_EQ(report.double_faced, 242u);
    EXPECT_EQ(report.crossings, 0u);
    EXPECT_THAT(report.warnings, IsEmpty());
}

TEST(MeshCrossings, FlapsThatTouchAlongALineDoNotCross) {
    // A sheet that is bent back until its border, at heights that rounding moves up and down, lies on its face.
    const auto bent = [](double border) {
        return grid_of(13, 9, false, false, [border](double u, double v) {
            const double angle = 1.5 * 0.5 * kTurn * u;
            return u < 1.0 ? Vec3(std::sin(angle) - 0.02 * u, 1.0 - std::cos(angle) * (1.0 - 0.1 * u), v)
                           : Vec3(-0.4, border, v + 0.03);
        });
    };
    Shape floor = grid_of(2, 2, false, false, [](double u, double v) { return Vec3(2 * u - 1.4, -0.4, 3 * v - 1); });
    const auto flaps = [&](double border) { return report_of_shape(Shape(floor).add(bent(border))); };
    EXPECT_EQ(flaps(-0.4).crossings, 0u);
    EXPECT_EQ(flaps(-0.4 + 1e-8).crossings, 0u);
    EXPECT_EQ(flaps(-0.4 - 1e-8).crossings, 0u) << "closer than the welding distance";
    EXPECT_GT(flaps(-0.41).crossings, 0u) << "through it";
    EXPECT_THAT(flaps(-0.4).warnings, Not(Contains(HasSubstr("passes through itself"))));
}

TEST(MeshCrossings, ATubeInTheShapeOfAnEightPassesThroughItself) {
    const Shape eight = grid_of(40, 8, true, true, [](double u, double v) {
        // Its strands cross in the middle, one a little higher than the other.
        const double t = kTurn * (u + 0.003);
        const Vec3 middle(std::sin(t), 0.05 * std::cos(t), std::sin(t) * std::cos(t));
        const Vec3 along = glm::normalize(Vec3(std::cos(t), 0.0, std::cos(2.0 * t)));
        const Vec3 across(along.z, 0.0, -along.x);
        return middle + 0.11 * (std::cos(kTurn * v) * across + Vec3(0.0, std::sin(kTurn * v), 0.0));
    });
    const std::size_t expected = pierced_by_brute_force(eight);
    EXPECT_GT(expected, 10u);
    const MeshReport report = report_of_shape(eight);
    EXPECT_EQ(report.crossings, expected);
    EXPECT_TRUE(report.closed);
    EXPECT_THAT(report.warnings,
                Contains(AllOf(HasSubstr("the mesh passes through itself: " + std::to_string(expected) +
                                         " edges pierce a triangle; tolerated, and not kept apart; the first is "
                                         "the edge from vertex "),
                               HasSubstr(", through triangle "))));
}

TEST(MeshCrossings, AMoebiusStripHasNone) {
    Shape strip = grid_of(24, 3, false, false, [](double u, double v) {
        const double angle = kTurn * u * 23.0 / 24.0;
        const Vec3 middle(std::cos(angle), std::sin(angle), 0.0);
        return middle + (0.6 * v - 0.3) * (std::cos(0.5 * angle) * middle + Vec3(0.0, 0.0, std::sin(0.5 * angle)));
    });
    for (std::uint32_t j = 0; j < 2; ++j) {  // the last row meets the first one upside down
        strip.triangles.push_back({69 + j, 2 - j, 70 + j});
        strip.triangles.push_back({70 + j, 2 - j, 1 - j});
    }
    const MeshReport report = report_of_shape(strip);
    EXPECT_FALSE(report.orientable);
    EXPECT_EQ(report.crossings, 0u);
    EXPECT_THAT(report.warnings,
                AllOf(Contains(HasSubstr("one side only")), Not(Contains(HasSubstr("passes through itself")))));
}

TEST(MeshCrossings, ABarThroughABoxIsNamed) {
    // The bar's four edges and the diagonals of its four sides each pass through two faces of the box.
    const Shape shape = box_of(Vec3(0.5)).add(box_of({1.0, 0.05, 0.06}), {0.0, 0.11, 0.27});
    ASSERT_EQ(pierced_by_brute_force(shape), 16u);
    const MeshReport report = report_of_shape(shape);
    EXPECT_EQ(report.crossings, 16u);
    EXPECT_EQ(report.components, 2u);
    EXPECT_THAT(
        report.warnings,
        Contains(AllOf(HasSubstr("16 edges pierce a triangle"), HasSubstr("the edge from vertex 8 to 9"),
                       HasSubstr("through triangle 8 (vertices 0, 4, 6) at (-0.500000, 0.060000, 0.210000) m"))));
}

TEST(MeshCrossings, ATeeWithACrowdedEdgeHasNone) {
    // Three sheets share the vertices of an edge; a fourth stands on a face without a common vertex.
    Shape tee{{{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {1, 0, 1}, {-1, 0, 0}, {-1, 0, 1}, {0, 1, 0}, {0, 1, 1}},
              {{0, 1, 3}, {0, 3, 2}, {0, 4, 5}, {0, 5, 1}, {0, 6, 7}, {0, 7, 1}}};
    tee.add({{{0.3, 0, 0.2}, {0.6, 0, 0.7}, {0.4, 0.5, 0.4}}, {{0, 1, 2}}});
    const MeshReport report = report_of_shape(tee);
    EXPECT_EQ(report.crowded_edges, 1u);
    EXPECT_EQ(report.crossings, 0u);
    EXPECT_THAT(report.warnings, AllOf(Contains(HasSubstr("more than two triangles")),
                                       Not(Contains(HasSubstr("passes through itself")))));
}

TEST(MeshCrossings, AThinClosedWedgeHasNone) {
    // 1 m long, a tenth of a millimetre thick at one end and nothing at the other.
    const Shape wedge{{{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {1, 0, 1}, {1, 1e-4, 0}, {1, 1e-4, 1}},
                      {{0, 3, 1}, {0, 2, 3}, {0, 1, 5}, {0, 5, 4}, {2, 5, 3}, {2, 4, 5}, {0, 4, 2}, {1, 3, 5}}};
    const MeshReport report = report_of_shape(wedge);
    EXPECT_EQ(report.crossings, 0u);
    EXPECT_TRUE(report.closed);
    EXPECT_THAT(report.warnings, Not(Contains(HasSubstr("passes through itself"))));
}

TEST(MeshCrossings, TheSearchOfAMeshWithoutOrderEnds) {
    // Every two of these slivers overlap.
    Shape slivers;
    for (std::uint32_t k = 0; k < 10'000; ++k) {
        const double angle = kTurn * k / 10'000.0;
        const Vec3 end(std::cos(angle), std::sin(angle), 1e-3 * k);
        slivers.add({{-end, end, end + Vec3(0.0, 0.0, 2e-4)}, {{0, 1, 2}}});
    }
    const MeshReport report = report_of_shape(slivers);
    EXPECT_FALSE(report.crossings_known);
    EXPECT_THAT(report.warnings, Contains(HasSubstr("the search for crossings was given up")));
}

}  // namespace
}  // namespace haptic::sim
