// Which surfaces may take the places of their skins at once: spheres that cross nothing and have their outside out.
#include "scene/lone_surfaces.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "contact/scenes.hpp"
#include "haptic/sim/block.hpp"
#include "haptic/sim/fish.hpp"
#include "haptic/sim/organ.hpp"
#include "mesh/mesh_topology.hpp"
#include "scene/assembly.hpp"
#include "scene_with.hpp"

namespace haptic::sim {
namespace {

/// A ring of n x m cells.
TriangleMesh torus(std::uint32_t n, std::uint32_t m) {
    TriangleMesh mesh;
    mesh.vertices.resize(std::size_t{n} * m);
    const auto at = [&](std::uint32_t i, std::uint32_t j) { return (i % n) * m + j % m; };
    for (std::uint32_t i = 0; i < n; ++i) {
        for (std::uint32_t j = 0; j < m; ++j) {
            mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
            mesh.triangles.push_back({at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
        }
    }
    return mesh;
}

bool is_a_sphere(const TriangleMesh& mesh) {
    return detail::is_sphere(mesh.triangles, mesh.vertices.size());
}

TEST(LoneSurfaces, SpheresAreClosedOfOnePieceAndWithoutHandles) {
    const TriangleMesh block = make_block_mesh({.cells = 3});
    EXPECT_TRUE(is_a_sphere(block));
    EXPECT_TRUE(is_a_sphere(make_fish_mesh({})));
    EXPECT_TRUE(is_a_sphere(make_organ_mesh({})));
    EXPECT_FALSE(is_a_sphere(scenes::sheet(1.0, 4, false)));
    EXPECT_FALSE(is_a_sphere(scenes::sheet(1.0, 4, true))) << "edges of four triangles";
    EXPECT_FALSE(is_a_sphere(torus(6, 5)));
    TriangleMesh two = block;
    detail::append(two, block);
    EXPECT_FALSE(is_a_sphere(two));
    TriangleMesh open = block;
    open.triangles.pop_back();
    EXPECT_FALSE(is_a_sphere(open));
    TriangleMesh turned = block;
    std::swap(turned.triangles[0][0], turned.triangles[0][1]);
    EXPECT_FALSE(is_a_sphere(turned));
    // Two spheres with two vertices in common have the characteristic of one.
    TriangleMesh pinched = two;
    const auto half = static_cast<std::uint32_t>(block.vertices.size());
    for (Triangle& t : pinched.triangles) {
        for (std::uint32_t& v : t) {
            v = v == half ? 0 : (v == half + 1 ? half - 1 : (v > half + 1 ? v - 2 : v));
        }
    }
    pinched.vertices.resize(2 * half - 2);
    EXPECT_FALSE(is_a_sphere(pinched));
}

TEST(LoneSurfaces, MayJumpWhereTheirSkinsCrossNothingAndHaveTheirOutsideOut) {
    const Assembly assembly(test::scene_with("fish-grab"));
    LoneSurfaces lone(assembly);
    std::vector<Vec3> vertices = assembly.mesh.vertices;
    EXPECT_TRUE(lone.may_jump(0, true, vertices));
    EXPECT_FALSE(lone.may_jump(0, false, vertices)) << "not alone";
    for (Vec3& v : vertices) {
        v = Vec3(v.x, v.y, -v.z);
    }
    EXPECT_FALSE(lone.may_jump(0, true, vertices)) << "inside out";
    // A tail that is led through the body.
    vertices = assembly.mesh.vertices;
    const auto [tail, head] = std::ranges::minmax_element(vertices, {}, [](const Vec3& v) { return v.x; });
    const double from = tail->x;
    const double length = head->x - from;
    for (Vec3& v : vertices) {
        const double beyond = std::max(0.0, from + 0.3 * length - v.x);
        v.x += 2.5 * beyond;
    }
    EXPECT_FALSE(lone.may_jump(0, true, vertices)) << "folded through itself";
}

TEST(LoneSurfaces, AreTestedWhileTheyLagWithoutCatchingUp) {
    const Assembly assembly(test::scene_with("fish-grab"));
    LoneSurfaces lone(assembly);
    const auto tests_in_a_second = [&](const auto& lag_at) {
        int tests = 0;
        for (int k = 1; k <= 64; ++k) {
            tests += lone.end_step(0, lag_at(k), 1.0 / 64.0) ? 1 : 0;
        }
        return tests;
    };
    EXPECT_EQ(tests_in_a_second([](int) { return 0.001; }), 3);
    EXPECT_EQ(tests_in_a_second([](int k) { return 0.001 * std::pow(0.99, k); }), 0);
    EXPECT_EQ(tests_in_a_second([](int k) { return k % 16 == 0 ? 0.0 : 0.001; }), 0);
}

TEST(LoneSurfaces, NeedNotWaitOnceTheyHaveBeenAloneForAWhile) {
    const Assembly assembly(test::scene_with("fish-grab"));
    LoneSurfaces lone(assembly);
    std::vector<Vec3> inside_out = assembly.mesh.vertices;
    for (Vec3& v : inside_out) {
        v.z = -v.z;
    }
    const auto need_not_wait_after = [&](bool alone) {
        EXPECT_FALSE(lone.may_jump(0, alone, inside_out));
        return lone.need_not_wait(0);
    };
    for (const bool alone : {true, true, false, true, true}) {
        EXPECT_FALSE(need_not_wait_after(alone));
    }
    EXPECT_TRUE(need_not_wait_after(true));
    EXPECT_FALSE(lone.end_step(0, 0.0, 0.01));
    EXPECT_FALSE(lone.need_not_wait(0)) << "it lags no more";
}

}  // namespace
}  // namespace haptic::sim
