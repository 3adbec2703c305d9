#include "haptic/sim/curtain.hpp"

#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <stdexcept>

namespace haptic::sim {
namespace {

TEST(Curtain, HasTheCountsOfTheThesis) {
    const TriangleMesh mesh = make_curtain_mesh({});
    EXPECT_EQ(mesh.vertices.size(), 1089u);
    EXPECT_EQ(mesh.triangles.size(), 4096u);
    EXPECT_FALSE(mesh.closed);
}

TEST(Curtain, HangsFromItsFirstRow) {
    const CurtainShape shape{.vertices_per_side = 5, .side = 2.0, .centre = {1.0, 2.0, 3.0}};
    const TriangleMesh mesh = make_curtain_mesh(shape);
    const ParticleModel model = make_curtain_particles(shape, 0.3, 1.0);
    EXPECT_NO_THROW(model.check());
    EXPECT_EQ(model.position, mesh.vertices);
    EXPECT_EQ(model.rest_position, mesh.vertices);
    for (std::uint32_t j = 0; j < 5; ++j) {
        for (std::uint32_t i = 0; i < 5; ++i) {
            const std::uint32_t at = j * 5 + i;
            EXPECT_EQ(mesh.vertices[at], Vec3(0.5 * i, 3.0 - 0.5 * j, 3.0));
            EXPECT_EQ(model.pinned[at], j == 0 ? 1 : 0);
        }
    }
}

TEST(Curtain, ShowsItsFrontAlongZ) {
    const TriangleMesh mesh = make_curtain_mesh({.vertices_per_side = 4});
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        const auto& [a, b, c] = mesh.triangles[t];
        const double z = glm::cross(mesh.vertices[b] - mesh.vertices[a], mesh.vertices[c] - mesh.vertices[a]).z;
        EXPECT_EQ(z > 0.0, t < mesh.triangles.size() / 2);
    }
}

TEST(Curtain, LinksKeepTheirLengthsWhereverItHangs) {
    const double half = std::sqrt(0.5);
    const ParticleModel model = make_curtain_particles(
        {.vertices_per_side = 3, .centre = {-1.0, 4.0, 0.0}, .orientation = {half, 0.0, half, 0.0}}, 0.3, 1.0);
    for (const Link& link : model.links) {
        EXPECT_NEAR(glm::length(model.position[link.second] - model.position[link.first]), link.rest_length, 1e-14);
    }
}

TEST(Curtain, RefusesInvalidShapes) {
    EXPECT_THROW((void)make_curtain_mesh({.vertices_per_side = 1}), std::invalid_argument);
    EXPECT_THROW((void)make_curtain_mesh({.side = 0.0}), std::invalid_argument);
    EXPECT_THROW((void)make_curtain_particles({.mass = -1.0}, 0.3, 1.0), std::invalid_argument);
}

}  // namespace
}  // namespace haptic::sim
