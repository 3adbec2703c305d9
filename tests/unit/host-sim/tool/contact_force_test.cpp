#include "haptic/sim/contact_force.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <glm/geometric.hpp>
#include <span>
#include <vector>

#include "haptic/sim/cloth.hpp"

namespace haptic::sim {
namespace {

class PressureMaskTest : public ::testing::Test {
  protected:
    [[nodiscard]] PressureMask mask_of(double radius) const {
        return {mesh, skin_of_particles(mesh.vertices.size()), mesh.vertices.size(), radius};
    }
    /// W_i of every particle.
    [[nodiscard]] std::vector<double> weights(std::span<const PressedParticle> pressed) const {
        std::vector<double> weight(mesh.vertices.size(), 0.0);
        for (const PressedParticle& p : pressed) {
            EXPECT_EQ(weight[p.particle], 0.0) << "twice: " << p.particle;
            weight[p.particle] = p.weight;
        }
        return weight;
    }
    /// A triangle whose first corner is the vertex.
    [[nodiscard]] std::uint32_t triangle_at(std::uint32_t vertex) const {
        std::uint32_t triangle = 0;
        while (mesh.triangles[triangle][0] != vertex) {
            ++triangle;
        }
        return triangle;
    }

    TriangleMesh mesh = make_cloth_mesh({});
};

TEST_F(PressureMaskTest, DividesTheWholeForce) {
    PressureMask mask = mask_of(0.1);
    double sum = 0.0;
    for (const PressedParticle& p : mask.center_on({.triangle = 1000, .weights = {0.2, 0.5, 0.3}})) {
        sum += p.weight;
    }
    EXPECT_NEAR(sum, 1.0, 1e-15);
}

TEST_F(PressureMaskTest, PressesOnlyWithinItsRadiusAndMostAtItsCentre) {
    PressureMask mask = mask_of(0.1);
    const std::uint32_t centre = 16 * 33 + 16;
    const std::vector<double> weight =
        weights(mask.center_on({.triangle = triangle_at(centre), .weights = {1.0, 0.0, 0.0}}));
    std::size_t pressed = 0;
    for (std::size_t j = 0; j < weight.size(); ++j) {
        // Equation 4.1, relative to the centre.
        const double distance = glm::length(mesh.vertices[j] - mesh.vertices[centre]);
        const double inside = distance < 0.1 ? 1.0 - distance * distance / 0.01 : 0.0;
        EXPECT_NEAR(weight[j], inside * inside * weight[centre], 1e-15) << "vertex " << j;
        pressed += weight[j] > 0.0 ? 1u : 0u;
    }
    EXPECT_EQ(pressed, 37u);  // grid points within 3.2 spacings
}

TEST_F(PressureMaskTest, MakesNoTorqueWhenCentredOnTheCloth) {
    PressureMask mask = mask_of(0.2);
    const std::uint32_t centre = 16 * 33 + 16;
    Vec3 torque(0.0);
    int pressed = 0;
    for (const PressedParticle& p : mask.center_on({.triangle = triangle_at(centre), .weights = {1.0, 0.0, 0.0}})) {
        const Vec3 force = p.weight * Vec3(0.0, -1.0, 0.0);
        torque += glm::cross(mesh.vertices[p.particle] - mesh.vertices[centre], force);
        ++pressed;
    }
    EXPECT_GT(pressed, 100);
    EXPECT_LT(glm::length(torque), 1e-15);
}

TEST_F(PressureMaskTest, FallsBackToTheTouchedTriangle) {
    PressureMask mask = mask_of(1e-6);
    const std::vector<double> weight = weights(mask.center_on({.triangle = 7, .weights = {0.25, 0.25, 0.5}}));
    const Triangle& corners = mesh.triangles[7];
    EXPECT_EQ(weight[corners[0]], 0.25);
    EXPECT_EQ(weight[corners[1]], 0.25);
    EXPECT_EQ(weight[corners[2]], 0.5);
}

TEST_F(PressureMaskTest, TakesTheCornersIfTheCallerHasNoRoomForMore) {
    PressureMask mask = mask_of(0.1);
    const SurfacePoint touched{.triangle = 1000, .weights = {0.2, 0.5, 0.3}};
    const std::size_t all = mask.center_on(touched).size();
    EXPECT_EQ(mask.center_on(touched, all).size(), all);
    const std::vector<double> weight = weights(mask.center_on(touched, all - 1));
    const Triangle& corners = mesh.triangles[1000];
    EXPECT_EQ(weight[corners[0]], 0.2);
    EXPECT_EQ(weight[corners[1]], 0.5);
    EXPECT_EQ(weight[corners[2]], 0.3);
}

}  // namespace
}  // namespace haptic::sim
