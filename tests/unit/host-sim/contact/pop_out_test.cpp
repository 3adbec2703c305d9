#include "haptic/sim/contact/pop_out.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "contact/oracle.hpp"
#include "contact/scenes.hpp"

namespace {

using haptic::Mat3;
using haptic::Vec3;
using haptic::sim::PopOut;
using haptic::sim::ProxyPath;
using haptic::sim::TriangleMesh;
using haptic::sim::oracle::Random;
using haptic::sim::scenes::Body;
using haptic::sim::scenes::placed;
using haptic::sim::scenes::sheet;
using haptic::sim::scenes::World;

constexpr double kRadius = 0.03;

struct Popped {
    PopOut result;
    std::size_t crossings = 0;
};

Popped pop(World& world, const Vec3& p) {
    static ProxyPath path;
    path.restart(p);
    Popped popped;
    popped.result = haptic::sim::pop_out(world.surfaces, p, kRadius, {}, &path);
    popped.crossings = haptic::sim::find_crossings(world.motions(), path.knots()).size();
    return popped;
}

/// The fan of the thesis' figure 4.14: a centre pressed down into a cone, the rim fixed.
TriangleMesh fan(double depth) {
    TriangleMesh mesh;
    mesh.vertices.emplace_back(0.0, -depth, 0.0);
    for (std::uint32_t k = 0; k < 32; ++k) {
        mesh.vertices.emplace_back(std::cos(k * M_PI / 16), 0.0, std::sin(k * M_PI / 16));
        mesh.triangles.push_back({0, 1 + (k + 1) % 32, 1 + k});
    }
    return mesh;
}

TEST(PopOut, LeavesAProxyThatIsClear) {
    World world;
    world.add(sheet(1.0, 8, true));
    world.refit();
    const Popped p = pop(world, {0, kRadius, 0});
    EXPECT_EQ(p.result.position, Vec3(0, kRadius, 0));
    EXPECT_EQ(p.result.iterations, 0);
}

TEST(PopOut, PushesToTheSideTheCentreIsOn) {
    World world;
    world.add(sheet(1.0, 8, true));
    world.refit();
    for (const double height : {0.02, 1e-3, 1e-6, -1e-6, -0.02}) {
        const Popped p = pop(world, {0.01, height, 0.02});
        EXPECT_NEAR(p.result.position.y, std::copysign(kRadius, height), 1e-9);
        EXPECT_NEAR(p.result.position.x, 0.01, 1e-9);
        EXPECT_FALSE(p.result.squeezed);
        EXPECT_EQ(p.crossings, 0u);
    }
}

TEST(PopOut, ClimbsOutOfANarrowFanWithoutFallingThrough) {
    Random random(50);
    for (const double depth : {1.0, 2.0, 3.0}) {
        World world;
        world.add(fan(depth));
        world.refit();
        int worst = 0;
        for (int k = 0; k < 200; ++k) {
            // Inside the cone, nearer to its tip than the sphere fits.
            const double height = random.uniform(0.0, 0.15) * depth;
            const double angle = random.uniform(0.0, 2.0 * M_PI);
            const double out = random.uniform(0.0, 0.95) * height / depth;
            const Vec3 p(out * std::cos(angle), -depth + height, out * std::sin(angle));
            const Popped popped = pop(world, p);
            ASSERT_EQ(popped.crossings, 0u) << depth << " " << k;
            ASSERT_FALSE(popped.result.squeezed) << depth << " " << k;
            ASSERT_GE(world.clearance(popped.result.position), 0.999 * kRadius) << depth << " " << k;
            worst = std::max(worst, popped.result.iterations);
        }
        EXPECT_LE(worst, 8) << depth << ": the thesis needs up to hundreds";
    }
}

TEST(PopOut, KeepsTheSideInTheThreeCasesOfFigure419) {
    // First: a clipping triangle must not push the proxy over the thin one in the middle.
    World clipped;
    Body& left = clipped.add(sheet(0.2, 1, false));
    Body& middle = clipped.add(sheet(0.2, 1, false));
    const Mat3 upright = haptic::sim::scenes::rotation({0, 0, 1}, M_PI / 2);
    left.start = left.end =
        placed(left.mesh.vertices, haptic::sim::scenes::rotation({0, 0, 1}, M_PI / 2 + 0.5), {-0.03, 0.0, 0});
    middle.start = middle.end = placed(middle.mesh.vertices, upright, {0.015, 0, 0});
    clipped.refit();
    const Popped one = pop(clipped, {0.004, 0.03, 0});
    EXPECT_EQ(one.crossings, 0u);
    EXPECT_LT(one.result.position.x, 0.015);
    // Second: between two parallel faces there is no room, and it says so, in the middle.
    World parallel;
    Body& below = parallel.add(sheet(0.5, 4, false));
    Body& above = parallel.add(sheet(0.5, 4, false));
    below.start = below.end = placed(below.mesh.vertices, Mat3(1.0), {0, -0.01, 0});
    above.start = above.end = placed(above.mesh.vertices, Mat3(1.0), {0, 0.02, 0});
    parallel.refit();
    const Popped two = pop(parallel, {0, 0.0, 0});
    EXPECT_EQ(two.crossings, 0u);
    EXPECT_TRUE(two.result.squeezed);
    EXPECT_NEAR(two.result.position.y, 0.005, 1e-4);
    EXPECT_NEAR(two.result.clearance, 0.015, 1e-4);
    // Third: a closed pocket smaller than the proxy.
    World pocket;
    pocket.add(haptic::sim::scenes::box({0.02, 0.025, 0.02}));
    pocket.refit();
    const Popped three = pop(pocket, {0.01, 0.0, -0.012});
    EXPECT_EQ(three.crossings, 0u);
    EXPECT_TRUE(three.result.squeezed);
    EXPECT_NEAR(three.result.clearance, 0.02, 1e-3);
}

TEST(PopOut, DoesNotDependOnTheOrderOfTriangles) {
    Random random(51);
    TriangleMesh mesh = fan(2.0);
    World world;
    world.add(mesh);
    world.refit();
    for (int k = 0; k < 30; ++k) {
        const Vec3 p = random.in_cube(0.01) + Vec3(0, -1.9, 0);
        const Vec3 reference = pop(world, p).result.position;
        for (std::size_t j = mesh.triangles.size() - 1; j > 0; --j) {
            std::swap(mesh.triangles[j], mesh.triangles[random.below(static_cast<std::uint32_t>(j + 1))]);
        }
        World other;
        other.add(mesh);
        other.refit();
        EXPECT_NEAR(glm::length(pop(other, p).result.position - reference), 0.0, 1e-9) << k;
    }
}

}  // namespace
