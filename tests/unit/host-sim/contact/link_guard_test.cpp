#include "contact/link_guard.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <numbers>
#include <random>
#include <vector>

#include "haptic/sim/mesh.hpp"
#include "haptic/sim/rigid_shapes.hpp"

namespace haptic::sim {
namespace {

/// A mesh at rest.
struct RestingMesh {
    explicit RestingMesh(TriangleMesh made) : mesh(std::move(made)), tree(mesh.vertices, mesh.triangles) {
        tree.refit({mesh.vertices, mesh.vertices, mesh.triangles});
    }
    [[nodiscard]] std::vector<MovingSurface> surfaces() const {
        return {{{mesh.vertices, mesh.vertices, mesh.triangles}, &tree}};
    }
    TriangleMesh mesh;
    SweptTree tree;
};

/// A rod along x, of 4 mm.
RestingMesh thin_rod() {
    return RestingMesh(make_rod_mesh({.length = 0.3, .diameter = 0.004}));
}

TEST(LinkGuard, SeesARodGetBetweenTwoSpheres) {
    const RestingMesh rod = thin_rod();
    const auto hit = find_link_hit(
        rod.surfaces(),
        {.a0 = {0.0, 0.012, -0.01}, .b0 = {0.0, 0.012, 0.01}, .a1 = {0.01, -0.03, -0.01}, .b1 = {0.01, -0.03, 0.01}});
    ASSERT_TRUE(hit.has_value());
    EXPECT_GT(hit->plane.normal.y, 0.999);  // up, toward the spheres before the move
    EXPECT_EQ(hit->plane.touched.object, 0u);
    EXPECT_NEAR(hit->plane.touched.weights.x + hit->plane.touched.weights.y + hit->plane.touched.weights.z, 1.0, 1e-12);
}

TEST(LinkGuard, LetsSpheresGoRoundARodOnTheSameSide) {
    const RestingMesh rod = thin_rod();
    EXPECT_FALSE(
        find_link_hit(
            rod.surfaces(),
            {.a0 = {0.0, 0.012, 0.005}, .b0 = {0.0, 0.012, 0.02}, .a1 = {0.0, -0.03, 0.015}, .b1 = {0.0, -0.03, 0.03}})
            .has_value());
    EXPECT_FALSE(
        find_link_hit(rod.surfaces(),
                      {.a0 = {0.0, 0.1, 0.0}, .b0 = {0.0, 0.1, 0.02}, .a1 = {0.0, 0.01, 0.0}, .b1 = {0.0, 0.01, 0.02}})
            .has_value());
    // Beyond the end of the rod.
    EXPECT_FALSE(find_link_hit(rod.surfaces(), {.a0 = {0.16, 0.012, -0.01},
                                                .b0 = {0.16, 0.012, 0.01},
                                                .a1 = {0.16, -0.03, -0.01},
                                                .b1 = {0.16, -0.03, 0.01}})
                     .has_value());
}

TEST(LinkGuard, KeepsNothingOfASegmentThatASurfaceAlreadyGoesThrough) {
    const RestingMesh rod = thin_rod();
    EXPECT_FALSE(
        find_link_hit(
            rod.surfaces(),
            {.a0 = {0.0, 0.001, -0.01}, .b0 = {0.0, 0.001, 0.01}, .a1 = {0.0, -0.03, -0.01}, .b1 = {0.0, -0.03, 0.01}})
            .has_value());
}

TEST(LinkGuard, FindsEveryLineThatAPatchIsMovedAcross) {
    // Oracle: a long thin rod along x is a line. Seen along x, the segment a b moves across the origin if the triangles
    // of its patch, projected to y-z, contain it.
    const RestingMesh rod{make_rod_mesh({.length = 200.0, .diameter = 1e-6})};
    const auto surfaces = rod.surfaces();
    std::mt19937_64 random(7);
    std::uniform_real_distribution<double> place(-1.0, 1.0);
    const auto holds = [](const Vec3& p, const Vec3& q, const Vec3& r) {
        const auto side = [](const Vec3& a, const Vec3& b) { return a.y * b.z - a.z * b.y; };
        const double u = side(p, q);
        const double v = side(q, r);
        const double w = side(r, p);
        return (u > 0.0) == (v > 0.0) && (v > 0.0) == (w > 0.0);
    };
    int hits = 0;
    for (int k = 0; k < 2'000; ++k) {
        const auto point = [&] {
            const double x = place(random);
            const double y = place(random);
            return Vec3(x, y, place(random));
        };
        const LinkMove move{point(), point(), point(), point()};
        const bool expected = holds(move.a0, move.b0, move.b1) || holds(move.a0, move.b1, move.a1);
        const auto hit = find_link_hit(surfaces, move);
        EXPECT_EQ(hit.has_value(), expected) << k;
        hits += expected ? 1 : 0;
        if (hit) {
            EXPECT_NEAR(glm::length(hit->plane.normal), 1.0, 1e-12);
            EXPECT_NEAR(glm::dot(hit->plane.normal, glm::normalize(move.b0 - move.a0)), 0.0, 1e-9);
        }
    }
    EXPECT_GT(hits, 300);
    EXPECT_LT(hits, 1'700);
}

}  // namespace
}  // namespace haptic::sim
