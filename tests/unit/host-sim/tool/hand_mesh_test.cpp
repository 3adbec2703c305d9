#include "tool/hand_mesh.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <stdexcept>

#include "contact/verification.hpp"
#include "haptic/sim/mesh_check.hpp"

namespace haptic::sim {
namespace {

const TriangleMesh& hand_mesh() {
    static const TriangleMesh mesh = make_hand_mesh(0.19);
    return mesh;
}

TEST(HandMesh, HasAsManyTrianglesAsTheThesisInOneClosedSkin) {
    EXPECT_EQ(hand_mesh().triangles.size(), 3906u);
    EXPECT_EQ(hand_mesh().vertices.size(), 1955u);  // Euler: V - 3/2 T + T = 2 for a closed surface of genus 0
    const MeshReport report = check_mesh(hand_mesh().vertices, hand_mesh().triangles, {}, "hand").report;
    EXPECT_TRUE(report.warnings.empty()) << report.warnings.front();
    EXPECT_TRUE(hand_mesh().closed && report.closed && !report.turned);
    EXPECT_EQ(report.components, 1u);
    EXPECT_EQ(report.welded + report.collapsed + report.flipped + report.degenerate, 0u);
}

TEST(HandMesh, HasTheSizeOfAHand) {
    const MeshReport report = check_mesh(hand_mesh().vertices, hand_mesh().triangles, {}, "hand").report;
    const Vec3 size = report.high - report.low;
    EXPECT_NEAR(size.z, 0.19, 1e-12);
    EXPECT_NEAR(size.x, 0.12, 0.02);  // spread
    EXPECT_NEAR(size.y, 0.045, 0.015);
    // A hand of 0.19 m without the wrist displaces about 0.35 litres; this one is 0.16 m long without it.
    EXPECT_GT(report.volume, 0.15e-3);
    EXPECT_LT(report.volume, 0.35e-3);
}

/// Whether a point, in units of the hand's length, is inside.
bool is_in(double x, double y, double z) {
    return winding_number(hand_mesh().vertices, hand_mesh().triangles, 0.19 * Vec3(x, y, z)) > 0.5;
}

/// Number of separate segments of a line along x, at given z and y, that are inside.
int crossings_at(double z, double y) {
    int count = 0;
    bool before = false;
    for (double x = -0.45; x < 0.35; x += 0.005) {
        const bool now = is_in(x, y, z);
        count += now && !before ? 1 : 0;
        before = now;
    }
    return count;
}

TEST(HandMesh, HasFiveSeparateFingers) {
    EXPECT_EQ(crossings_at(0.2, -0.01), 1);    // wrist
    EXPECT_EQ(crossings_at(-0.05, -0.01), 1);  // palm; the thumb is below
    EXPECT_EQ(crossings_at(-0.08, -0.09), 1);  // the thumb alone
    EXPECT_EQ(crossings_at(-0.28, -0.02), 4);  // four fingers
    EXPECT_TRUE(is_in(-0.3, -0.1, -0.08));     // the thumb is at -x: a right hand
    EXPECT_FALSE(is_in(0.2, -0.1, -0.08));
    EXPECT_GT(crossings_at(-0.28, -0.02), crossings_at(-0.5, -0.09));  // the middle finger is the longest
}

TEST(HandMesh, HasTrianglesOfEvenSize) {
    double min_edge = 1.0;
    double longest = 0.0;
    for (const Triangle& t : hand_mesh().triangles) {
        for (std::size_t k = 0; k < 3; ++k) {
            const double edge = glm::length(hand_mesh().vertices[t[(k + 1) % 3]] - hand_mesh().vertices[t[k]]);
            min_edge = std::min(min_edge, edge);
            longest = std::max(longest, edge);
        }
    }
    // Area per triangle corresponds to edges of 5 mm.
    EXPECT_GT(min_edge, 0.0005);
    EXPECT_LT(longest, 0.010);
}

TEST(HandMesh, HasTheRequestedLength) {
    const TriangleMesh twice = make_hand_mesh(0.38);
    ASSERT_EQ(twice.vertices.size(), hand_mesh().vertices.size());
    for (std::size_t i = 0; i < twice.vertices.size(); ++i) {
        EXPECT_NEAR(glm::length(twice.vertices[i] - 2.0 * hand_mesh().vertices[i]), 0.0, 1e-15);
    }
    EXPECT_THROW((void)make_hand_mesh(0.0), std::invalid_argument);
}

}  // namespace
}  // namespace haptic::sim
