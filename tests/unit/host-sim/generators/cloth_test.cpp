#include "haptic/sim/cloth.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <set>
#include <stdexcept>

namespace haptic::sim {
namespace {

TEST(Cloth, HasTheCountsOfTheThesis) {
    const TriangleMesh mesh = make_cloth_mesh({});
    EXPECT_EQ(mesh.vertices.size(), 1089u);
    EXPECT_EQ(mesh.triangles.size(), 4096u);
    EXPECT_FALSE(mesh.closed);
    const ParticleModel model = make_cloth_particles({}, 1.0, 1.0);
    EXPECT_EQ(model.size(), 1089u);
    EXPECT_EQ(model.groups.size(), 1089u);
    EXPECT_EQ(model.links.size(), 4160u);  // 2 * 32 * 33 along the grid, 2 * 32 * 32 across
}

TEST(Cloth, CollidesWithBallsThatTouchAlongTheGrid) {
    const ParticleModel model = make_cloth_particles({.vertices_per_side = 5, .side = 0.4}, 1.0, 1.0);
    for (const Vec3& axes : model.semi_axes) {
        EXPECT_EQ(axes, Vec3(0.05));  // m, half a cell
    }
}

TEST(Cloth, HasEveryTriangleOncePerFace) {
    const TriangleMesh mesh = make_cloth_mesh({.vertices_per_side = 9});
    std::set<Triangle> seen;
    double area = 0.0;
    for (const Triangle& t : mesh.triangles) {
        const auto least = std::min({t[0], t[1], t[2]});
        Triangle rotated = t;
        while (rotated[0] != least) {
            rotated = {rotated[1], rotated[2], rotated[0]};
        }
        EXPECT_TRUE(seen.insert(rotated).second);
    }
    for (const Triangle& t : seen) {
        EXPECT_TRUE(seen.contains({t[0], t[2], t[1]}));
        area += 0.5 * glm::length(glm::cross(mesh.vertices[t[1]] - mesh.vertices[t[0]],
                                             mesh.vertices[t[2]] - mesh.vertices[t[0]]));
    }
    EXPECT_NEAR(area, 2.0, 1e-12);  // m^2, both faces
}

TEST(Cloth, ShowsItsFrontUpward) {
    const TriangleMesh mesh = make_cloth_mesh({.vertices_per_side = 5});
    for (std::size_t t = 0; t < mesh.triangles.size() / 2; ++t) {
        const auto& [a, b, c] = mesh.triangles[t];
        EXPECT_GT(glm::cross(mesh.vertices[b] - mesh.vertices[a], mesh.vertices[c] - mesh.vertices[a]).y, 0.0);
    }
}

TEST(Cloth, LinksAnInnerParticleToEightNeighbours) {
    const ParticleModel model = make_cloth_particles({.vertices_per_side = 4}, 1.0, 1.0);
    EXPECT_EQ(model.groups[5].members.size(), 9u);
    EXPECT_EQ(model.groups[0].members.size(), 4u);
    EXPECT_EQ(model.groups[1].members.size(), 6u);
    EXPECT_NO_THROW(model.check());
}

TEST(Cloth, FollowsItsPlacement) {
    const double half = std::sqrt(0.5);
    const ClothShape shape{
        .vertices_per_side = 3, .side = 2.0, .centre = {1.0, 2.0, 3.0}, .orientation = {half, half, 0, 0}};
    const TriangleMesh mesh = make_cloth_mesh(shape);
    // A quarter turn about x takes the cloth's z to -y.
    EXPECT_NEAR(glm::length(mesh.vertices[8] - Vec3(2.0, 1.0, 3.0)), 0.0, 1e-15);
    EXPECT_EQ(make_cloth_particles(shape, 1.0, 1.0).position, mesh.vertices);
}

TEST(Cloth, RefusesInvalidShapes) {
    EXPECT_THROW((void)make_cloth_mesh({.vertices_per_side = 1}), std::invalid_argument);
    EXPECT_THROW((void)make_cloth_mesh({.side = 0.0}), std::invalid_argument);
    EXPECT_THROW((void)make_cloth_particles({.mass = -1.0}, 1.0, 1.0), std::invalid_argument);
}

}  // namespace
}  // namespace haptic::sim
