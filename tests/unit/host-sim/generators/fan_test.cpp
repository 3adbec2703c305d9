#include "haptic/sim/fan.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>
#include <set>
#include <stdexcept>

namespace haptic::sim {
namespace {

TEST(Fan, HasTheCountsOfTheThesis) {
    const TriangleMesh mesh = make_fan_mesh({});
    EXPECT_EQ(mesh.vertices.size(), 33u);
    EXPECT_EQ(mesh.triangles.size(), 32u);
    EXPECT_FALSE(mesh.closed);
}

TEST(Fan, HasItsRimOnACircle) {
    // The angle is rounded to 4e-16; the products with 2 m add the same again.
    for (const std::uint32_t n : {3u, 5u, 10u, 32u, 1023u}) {
        const TriangleMesh mesh = make_fan_mesh({.rim_vertices = n, .rim_radius = 2.0, .centre = {1.0, -1.0, 0.5}});
        for (std::uint32_t k = 0; k < n; ++k) {
            const double angle = 2.0 * std::numbers::pi * k / n;
            const Vec3 expected(1.0 + 2.0 * std::cos(angle), -1.0, 0.5 - 2.0 * std::sin(angle));
            EXPECT_NEAR(glm::length(mesh.vertices[1 + k] - expected), 0.0, 4e-15) << k << " of " << n;
        }
    }
}

TEST(Fan, ShowsItsFrontUpward) {
    const TriangleMesh mesh = make_fan_mesh({.rim_vertices = 7});
    double area = 0.0;
    for (const auto& [a, b, c] : mesh.triangles) {
        const Vec3 n = glm::cross(mesh.vertices[b] - mesh.vertices[a], mesh.vertices[c] - mesh.vertices[a]);
        EXPECT_GT(n.y, 0.0);
        area += 0.5 * n.y;
    }
    EXPECT_NEAR(area, 0.5 * 7 * 16.0 * std::sin(2.0 * std::numbers::pi / 7), 1e-13);  // m^2, of a regular heptagon
}

TEST(Fan, LeavesOnlyItsCentreFree) {
    const FanShape shape{.mass = 0.33};
    const ParticleModel model = make_fan_particles(shape, 0.3);
    EXPECT_NO_THROW(model.check());
    EXPECT_EQ(model.position, make_fan_mesh(shape).vertices);
    EXPECT_EQ(model.pinned[0], 0);
    for (std::size_t i = 1; i < model.size(); ++i) {
        EXPECT_EQ(model.pinned[i], 1);
    }
    EXPECT_DOUBLE_EQ(model.mass[0], 0.01);
    EXPECT_TRUE(model.links.empty());
}

TEST(Fan, MatchesEachParticleWithItsNeighboursOnTheFan) {
    const TriangleMesh mesh = make_fan_mesh({.rim_vertices = 5});
    const ParticleModel model = make_fan_particles({.rim_vertices = 5}, 0.3);
    ASSERT_EQ(model.groups.size(), model.size());
    for (const Group& group : model.groups) {
        std::set<std::uint32_t> expected;
        for (const Triangle& t : mesh.triangles) {
            if (std::find(t.begin(), t.end(), group.centre) != t.end()) {
                expected.insert(t.begin(), t.end());
            }
        }
        EXPECT_EQ(std::set<std::uint32_t>(group.members.begin(), group.members.end()), expected) << group.centre;
        EXPECT_EQ(group.members.size(), expected.size()) << group.centre;
        EXPECT_DOUBLE_EQ(group.stiffness, 0.3);
    }
}

TEST(Fan, RefusesInvalidShapes) {
    EXPECT_THROW((void)make_fan_mesh({.rim_vertices = 2}), std::invalid_argument);
    EXPECT_THROW((void)make_fan_mesh({.rim_vertices = 5000}), std::invalid_argument);
    EXPECT_THROW((void)make_fan_mesh({.rim_radius = -1.0}), std::invalid_argument);
    EXPECT_THROW((void)make_fan_particles({.mass = std::numeric_limits<double>::infinity()}, 0.3),
                 std::invalid_argument);
}

}  // namespace
}  // namespace haptic::sim
