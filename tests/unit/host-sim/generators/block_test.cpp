#include "haptic/sim/block.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <map>
#include <stdexcept>
#include <utility>

#include "haptic/sim/mesh_check.hpp"

namespace haptic::sim {
namespace {

/// Each edge is traversed once in each direction.
void expect_block_is_watertight(const TriangleMesh& mesh) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, int> sides;
    for (const auto& [a, b, c] : mesh.triangles) {
        ++sides[{a, b}];
        ++sides[{b, c}];
        ++sides[{c, a}];
    }
    for (const auto& [side, count] : sides) {
        EXPECT_EQ(count, 1) << side.first << " - " << side.second;
        EXPECT_TRUE(sides.contains({side.second, side.first})) << side.first << " - " << side.second;
    }
    EXPECT_TRUE(mesh.closed);
}

TEST(Block, IsAClosedBoxOfItsSize) {
    for (const BlockShape& shape :
         {BlockShape{}, BlockShape{.size = {2.0, 0.25, 3.0}, .cells = 1},
          BlockShape{.size = {0.1, 0.3, 0.2}, .cells = 7}, BlockShape{.size = {1e-4, 1e-4, 1.0}, .cells = 5},
          BlockShape{.size = {1.0, 1.0, 1.0}, .cells = 3}}) {
        const TriangleMesh mesh = make_block_mesh(shape);
        EXPECT_EQ(mesh.triangles.size(), block_triangles(shape));
        EXPECT_EQ(mesh.vertices.size(), mesh.triangles.size() / 2 + 2);  // Euler
        expect_block_is_watertight(mesh);
        const MeshReport report = check_mesh(mesh.vertices, mesh.triangles, {}, "block").report;
        EXPECT_TRUE(report.warnings.empty());
        EXPECT_TRUE(report.closed && !report.turned);
        EXPECT_EQ(report.welded + report.unused + report.collapsed + report.flipped + report.degenerate, 0u);
        EXPECT_EQ(report.components, 1u);
        // To rounding.
        const double box = shape.size.x * shape.size.y * shape.size.z;
        EXPECT_NEAR(report.volume, box, 1e-12 * box);
        EXPECT_EQ(report.low, -0.5 * shape.size);
        EXPECT_EQ(report.high, 0.5 * shape.size);
        for (const Vec3& p : mesh.vertices) {
            const Vec3 q = glm::abs(p) / shape.size;
            EXPECT_EQ(std::max({q.x, q.y, q.z}), 0.5);
        }
    }
}

TEST(Block, HasCellsNoWiderThanThoseOfItsLongestSide) {
    EXPECT_EQ(block_triangles({}), 4u * (12 * 4 + 4 * 8 + 8 * 12));  // cubic cells of 1 cm
    const BlockShape shape{.size = {0.3, 0.11, 0.2}, .cells = 10};   // cells of 3 cm at most: 10, 4, 7
    EXPECT_EQ(block_triangles(shape), 4u * (10 * 4 + 4 * 7 + 7 * 10));
    const TriangleMesh mesh = make_block_mesh(shape);
    double longest = 0.0;
    double shortest = 1.0;
    for (const auto& [a, b, c] : mesh.triangles) {
        for (const auto& [p, q] : {std::pair{a, b}, {b, c}, {c, a}}) {
            const double edge = glm::length(mesh.vertices[p] - mesh.vertices[q]);
            longest = std::max(longest, edge);
            shortest = std::min(shortest, edge);
        }
    }
    EXPECT_LE(longest, 0.03 * std::sqrt(2.0) * (1.0 + 1e-12));  // a diagonal
    EXPECT_GE(shortest, 0.11 / 4 * (1.0 - 1e-12));
}

TEST(Block, IsTheSameEachTime) {
    const TriangleMesh first = make_block_mesh({});
    const TriangleMesh second = make_block_mesh({});
    EXPECT_EQ(first.vertices, second.vertices);
    EXPECT_EQ(first.triangles, second.triangles);
}

TEST(Block, RefusesInvalidShapes) {
    EXPECT_THROW((void)make_block_mesh({.cells = 0}), std::invalid_argument);
    EXPECT_THROW((void)make_block_mesh({.cells = 257}), std::invalid_argument);
    EXPECT_THROW((void)make_block_mesh({.size = {1.0, 0.0, 1.0}}), std::invalid_argument);
    EXPECT_THROW((void)make_block_mesh({.size = {1.0, 1.0, -1.0}}), std::invalid_argument);
    EXPECT_THROW((void)make_block_mesh({.size = {std::numeric_limits<double>::infinity(), 1.0, 1.0}}),
                 std::invalid_argument);
    EXPECT_THROW((void)make_block_mesh({.size = {1.0, std::numeric_limits<double>::quiet_NaN(), 1.0}}),
                 std::invalid_argument);
}

}  // namespace
}  // namespace haptic::sim
