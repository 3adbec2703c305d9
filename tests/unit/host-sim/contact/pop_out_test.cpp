#include "contact/pop_out.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "contact/oracle.hpp"
#include "contact/scenes.hpp"
#include "contact/tight_places.hpp"

namespace {

using haptic::Mat3;
using haptic::Vec3;
using haptic::sim::PopOut;
using haptic::sim::ProxyPath;
using haptic::sim::TriangleMesh;
using haptic::sim::oracle::Random;
using haptic::sim::scenes::Body;
using haptic::sim::scenes::kRadius;
using haptic::sim::scenes::placed;
using haptic::sim::scenes::sheet;
using haptic::sim::scenes::World;
using haptic::sim::tight::fan;
using haptic::sim::tight::shuffle;

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
        EXPECT_FALSE(p.result.overconstrained);
        EXPECT_EQ(p.crossings, 0u);
    }
}

TEST(PopOut, ClimbsOutOfANarrowFanWithoutFallingThrough) {
    Random random(50);
    for (const double depth : {1.0, 2.0, 3.0}) {
        World world;
        world.add(fan(1.0, depth));
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
            ASSERT_FALSE(popped.result.overconstrained) << depth << " " << k;
            ASSERT_GE(world.clearance(popped.result.position), 0.999 * kRadius) << depth << " " << k;
            worst = std::max(worst, popped.result.iterations);
        }
        EXPECT_LE(worst, 8) << depth << ": the thesis needs up to hundreds";
    }
}

// The three cases of figure 4.19 of the thesis and its fan, in 1,000 random orders of the triangles each.
// thesis_pop_out_test.cpp shows what Algorithm 2 does there.

/// Pops a proxy out of the mesh in 1,000 random orders of its triangles. The end must be the same each time, without a
/// crossing. Returns it.
PopOut in_any_order(TriangleMesh mesh, const Vec3& p, std::uint64_t seed) {
    Random random(seed);
    PopOut first;
    for (int k = 0; k < 1000; ++k) {
        World world;
        world.add(mesh);
        world.refit();
        const Popped popped = pop(world, p);
        first = k == 0 ? popped.result : first;
        EXPECT_EQ(popped.crossings, 0u) << k;
        EXPECT_LE(glm::length(popped.result.position - first.position), 1e-9) << k;
        EXPECT_EQ(popped.result.overconstrained, first.overconstrained) << k;
        if (testing::Test::HasFailure()) {
            break;
        }
        shuffle(mesh, random);
    }
    return first;
}

TEST(PopOut, KeepsItsSideOfAThinWallThoughATriangleClips) {
    const PopOut popped = in_any_order(haptic::sim::tight::clipped_wall(4), haptic::sim::tight::kBesideWall, 51);
    // There are 0.7 radii between the wall and the clipping face: it stays in the middle and reports that it has no
    // room.
    EXPECT_NEAR(popped.position.x, 0.5 * haptic::sim::tight::kClip, 1e-3 * kRadius);
    EXPECT_TRUE(popped.overconstrained);
    EXPECT_NEAR(popped.clearance, 0.5 * haptic::sim::tight::kClip, 1e-3 * kRadius);
}

TEST(PopOut, StaysInTheMiddleOfParallelFacesAndSaysSo) {
    for (const double half : {0.7 * kRadius, 0.45 * kRadius, 0.05 * kRadius}) {
        TriangleMesh mesh;
        haptic::sim::tight::append(mesh, sheet(0.5, 4, false), Mat3(1.0), {0, -half, 0});
        haptic::sim::tight::append(mesh, sheet(0.5, 4, false), Mat3(1.0), {0, half, 0});
        const PopOut popped = in_any_order(mesh, {0.01, 0.3 * half, 0.02}, 52);
        EXPECT_TRUE(popped.overconstrained);
        EXPECT_NEAR(popped.position.y, 0.0, 1e-3 * kRadius) << half;
        EXPECT_NEAR(popped.clearance, half, 1e-3 * kRadius) << half;
    }
}

TEST(PopOut, StaysInAPocketThatIsTooSmallWhereThereIsMostRoom) {
    const Vec3 half = haptic::sim::tight::kPocket;
    const PopOut popped = in_any_order(haptic::sim::scenes::box(half), haptic::sim::tight::kInPocket, 53);
    EXPECT_TRUE(popped.overconstrained);
    EXPECT_NEAR(popped.clearance, half.x, 1e-3 * kRadius);
    EXPECT_NEAR(popped.position.x, 0.0, 1e-3 * kRadius);
    EXPECT_NEAR(popped.position.z, 0.0, 1e-3 * kRadius);
}

TEST(PopOut, ClimbsOutOfAFanToTheSamePlaceInAnyOrderOfItsTriangles) {
    Random random(54);
    for (const double depth : {1.0, 2.0, 3.0}) {
        for (const double rim : {1.0, 4.0}) {
            const double height = random.uniform(0.2, 0.9) * kRadius;
            const Vec3 p(0.1 * rim / depth * height, height - depth, -0.3 * rim / depth * height);
            const PopOut popped = in_any_order(fan(rim, depth), p, 55);
            EXPECT_FALSE(popped.overconstrained) << depth << " " << rim;
            EXPECT_LE(popped.iterations, 100) << depth << " " << rim;
            // Still inside the cone, as near to its faces as possible.
            World world;
            world.add(fan(rim, depth));
            EXPECT_GT(popped.position.y, -depth + height);
            EXPECT_GE(world.clearance(popped.position), 0.999 * kRadius);
            EXPECT_LE(world.clearance(popped.position), 1.1 * kRadius);
        }
    }
}

TEST(PopOut, DoesNotDependOnTheOrderOfTrianglesOfACrumpledSheet) {
    Random random(56);
    for (int k = 0; k < 12; ++k) {
        TriangleMesh mesh = sheet(8.0 * kRadius, 8, k % 2 == 0);
        for (Vec3& v : mesh.vertices) {
            v += random.in_cube(0.45 * kRadius);
        }
        Vec3 p(0.0);
        World world;
        world.add(mesh);
        do {
            p = random.in_cube(2.0 * kRadius);
        } while (world.clearance(p) > 0.7 * kRadius);
        (void)in_any_order(mesh, p, 57);
        if (HasFailure()) {
            ADD_FAILURE() << "sheet " << k;
            break;
        }
    }
}

}  // namespace
