#include "haptic/sim/contact_force.hpp"

#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <numeric>
#include <random>
#include <vector>

#include "haptic/sim/cloth.hpp"

namespace haptic::sim {
namespace {

SurfacePlanes planes(const std::vector<Vec3>& normals) {
    SurfacePlanes result;
    for (const Vec3& n : normals) {
        result.plane[result.count++].normal = glm::normalize(n);
    }
    return result;
}

Vec3 sum(std::span<const Vec3> forces) {
    return std::accumulate(forces.begin(), forces.end(), Vec3(0.0));
}

TEST(DivideForce, DividesASumOfNormalsIntoItsParts) {
    const SurfacePlanes contacts = planes({{1, 0, 0}, {1, 2, 0}, {0, 1, 3}});
    const ContactShares strength{2.0, 3.0, 5.0};
    Vec3 force(0.0);
    for (std::size_t c = 0; c < 3; ++c) {
        force += strength[c] * contacts.plane[c].normal;
    }
    const ContactShares shares = divide_force(force, contacts);
    for (std::size_t c = 0; c < 3; ++c) {
        EXPECT_NEAR(shares[c], strength[c], 1e-6);
    }
}

TEST(DivideForce, NeverPullsAtASurface) {
    std::mt19937 random(5);
    std::normal_distribution<double> normal;
    const auto vector = [&] { return Vec3(normal(random), normal(random), normal(random)); };
    for (int i = 0; i < 1000; ++i) {
        const SurfacePlanes contacts = planes({vector(), vector(), vector()});
        const ContactShares shares = divide_force(vector(), contacts);
        for (const double share : shares) {
            EXPECT_GE(share, 0.0);
            EXPECT_TRUE(std::isfinite(share));
        }
    }
}

TEST(DivideForce, GivesASinglePlaneTheWholeNormalForce) {
    const ContactShares shares = divide_force({0.0, 7.0, 0.0}, planes({{0, 2, 0}}));
    EXPECT_EQ(shares[0], 7.0);
    EXPECT_EQ(divide_force({1.0, 2.0, 3.0}, {})[0], 0.0);
}

TEST(ContactPush, IsTheSpringAloneWithoutDampingOrMotion) {
    EXPECT_EQ(contact_damping(3.0, 0.002, 0.01, {.stiffness = 20.0, .hunt_crossley_damping = 0.0}), 0.0);
    EXPECT_EQ(contact_push(3.0, 14.0, 0.0), 3.0);
    EXPECT_EQ(contact_push(3.0, 0.0, 0.5), 3.0);
}

TEST(ContactPush, ResistsApproachMoreThanRetreatAndNeverPulls) {
    EXPECT_EQ(contact_push(3.0, 5.0, 0.5), 5.5);
    EXPECT_EQ(contact_push(3.0, -5.0, 0.5), 0.5);
    EXPECT_EQ(contact_push(3.0, -500.0, 0.5), 0.0);
}

TEST(ContactDamping, IsHuntCrossleyForAHeavyPatch) {
    EXPECT_NEAR(contact_damping(5.0, 1e9, 0.01, {.hunt_crossley_damping = 2.0}), 10.0, 1e-6);
}

TEST(ContactDamping, NeverReversesAPatchHoweverLight) {
    const double step = 0.01;
    for (const double mass : {1e-6, 1e-3, 1.0}) {
        for (const double closing : {0.1, 14.0, 1000.0}) {
            const double by_loss = closing * contact_damping(5.0, mass, step, {.hunt_crossley_damping = 10.0});
            EXPECT_LE(by_loss * step / mass, closing * (1.0 + 1e-9));
        }
    }
}

class PressureMaskTest : public ::testing::Test {
  protected:
    TriangleMesh mesh = make_cloth_mesh({});
    std::vector<double> mass = std::vector<double>(mesh.vertices.size(), 1e-4);
    std::vector<Vec3> still = std::vector<Vec3>(mesh.vertices.size(), Vec3(0.0));
    std::vector<Vec3> force = still;
};

TEST_F(PressureMaskTest, AppliesExactlyTheForceItIsGiven) {
    PressureMask mask(mesh, skin_of_particles(mesh.vertices.size()), mass, 0.1);
    const Vec3 given(0.3, -7.0, 1.1);
    (void)mask.center_on({.triangle = 1000, .weights = {0.2, 0.5, 0.3}}, still);
    mask.press(given, force);
    EXPECT_LT(glm::length(sum(force) - given), 1e-14 * glm::length(given) * 100);
}

TEST_F(PressureMaskTest, PressesOnlyWithinItsRadiusAndMostAtItsCentre) {
    PressureMask mask(mesh, skin_of_particles(mesh.vertices.size()), mass, 0.1);
    const std::uint32_t centre = 16 * 33 + 16;
    std::uint32_t triangle = 0;
    while (mesh.triangles[triangle][0] != centre) {
        ++triangle;
    }
    (void)mask.center_on({.triangle = triangle, .weights = {1.0, 0.0, 0.0}}, still);
    mask.press({0.0, -1.0, 0.0}, force);
    std::size_t pressed = 0;
    for (std::size_t j = 0; j < force.size(); ++j) {
        const double distance = glm::length(mesh.vertices[j] - mesh.vertices[centre]);
        EXPECT_EQ(force[j].y < 0.0, distance < 0.1) << "vertex " << j;
        EXPECT_GE(force[j].y, force[centre].y);
        pressed += force[j].y < 0.0 ? 1u : 0u;
    }
    EXPECT_EQ(pressed, 37u);  // grid points within 3.2 spacings
}

TEST_F(PressureMaskTest, MakesNoTorqueWhenCentredOnTheCloth) {
    PressureMask mask(mesh, skin_of_particles(mesh.vertices.size()), mass, 0.2);
    const std::uint32_t centre = 16 * 33 + 16;
    std::uint32_t triangle = 0;
    while (mesh.triangles[triangle][0] != centre) {
        ++triangle;
    }
    (void)mask.center_on({.triangle = triangle, .weights = {1.0, 0.0, 0.0}}, still);
    mask.press({0.0, -1.0, 0.0}, force);
    Vec3 torque(0.0);
    for (std::size_t j = 0; j < force.size(); ++j) {
        torque += glm::cross(mesh.vertices[j] - mesh.vertices[centre], force[j]);
    }
    EXPECT_LT(glm::length(torque), 1e-15);
}

TEST_F(PressureMaskTest, ReportsMassAndVelocityOfThePatch) {
    PressureMask mask(mesh, skin_of_particles(mesh.vertices.size()), mass, 0.1);
    const std::vector<Vec3> moving(mesh.vertices.size(), Vec3(1.0, -2.0, 3.0));
    const PressedPatch patch = mask.center_on({.triangle = 1000, .weights = {0.2, 0.5, 0.3}}, moving);
    EXPECT_LT(glm::length(patch.velocity - Vec3(1.0, -2.0, 3.0)), 1e-14);
    // A force changes the patch's velocity as if all of it acted on the patch's mass.
    mask.press({0.0, 1.0, 0.0}, force);
    std::vector<Vec3> pushed = still;
    for (std::size_t j = 0; j < pushed.size(); ++j) {
        pushed[j] = force[j] / mass[j];
    }
    const PressedPatch after = mask.center_on({.triangle = 1000, .weights = {0.2, 0.5, 0.3}}, pushed);
    EXPECT_NEAR(after.velocity.y, 1.0 / patch.mass, 1e-9 / patch.mass);
    // The mask (1 - r^2)^2 on a disk has the effective mass of 5/9 of it; the cloth has 1,089 masses on 1 m^2.
    EXPECT_NEAR(patch.mass, 5.0 / 9.0 * 3.14159 * 0.01 * 1e-4 * 1024, 0.1 * patch.mass);
}

TEST_F(PressureMaskTest, FallsBackToTheTouchedTriangle) {
    PressureMask mask(mesh, skin_of_particles(mesh.vertices.size()), mass, 1e-6);
    (void)mask.center_on({.triangle = 7, .weights = {0.25, 0.25, 0.5}}, still);
    mask.press({0.0, 1.0, 0.0}, force);
    const Triangle& corners = mesh.triangles[7];
    EXPECT_EQ(force[corners[0]].y, 0.25);
    EXPECT_EQ(force[corners[2]].y, 0.5);
    EXPECT_EQ(sum(force).y, 1.0);
}

}  // namespace
}  // namespace haptic::sim
