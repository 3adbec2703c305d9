// Which surfaces may go to their skins at once: spheres that are alone, cross nothing and have their outside out.
#include "scene/lone_surfaces.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <span>
#include <utility>
#include <vector>

#include "contact/scenes.hpp"
#include "haptic/sim/block.hpp"
#include "haptic/sim/fish.hpp"
#include "haptic/sim/organ.hpp"
#include "haptic/sim/skin.hpp"
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

const LoneTool kFarTool{{Vec3(100.0), Vec3(101.0)}, {}};
const Aabb kWide{Vec3(-10.0), Vec3(10.0)};

/// Whether the first body may jump, alone in its group but for the tool.
bool first_may_jump(LoneSurfaces& lone, const std::vector<Vec3>& from, const std::vector<Vec3>& to,
                    const LoneTool& tool = kFarTool) {
    lone.rooms()[0] = kWide;
    EXPECT_TRUE(lone.is_alone(0, tool));
    std::vector<std::uint8_t> jumps = {1};
    const bool may = lone.may_jump(jumps, from, to);
    EXPECT_EQ(jumps[0] == 1, may);
    return may;
}

TEST(LoneSurfaces, MayJumpWhereTheyCrossNothingAndHaveTheirOutsideOut) {
    const Assembly assembly(test::scene_with("fish-grab"));
    LoneSurfaces lone(assembly);
    std::vector<Vec3> vertices = assembly.mesh.vertices;
    EXPECT_TRUE(first_may_jump(lone, assembly.mesh.vertices, vertices));
    for (Vec3& v : vertices) {
        v = Vec3(v.x, v.y, -v.z);
    }
    EXPECT_FALSE(first_may_jump(lone, assembly.mesh.vertices, vertices)) << "inside out";
    // A tail that is led through the body.
    vertices = assembly.mesh.vertices;
    const auto [tail, head] = std::ranges::minmax_element(vertices, {}, [](const Vec3& v) { return v.x; });
    const double from = tail->x;
    const double length = head->x - from;
    for (Vec3& v : vertices) {
        const double beyond = std::max(0.0, from + 0.3 * length - v.x);
        v.x += 2.5 * beyond;
    }
    EXPECT_FALSE(first_may_jump(lone, assembly.mesh.vertices, vertices)) << "folded through itself";
    std::vector<std::uint8_t> none = {0};
    EXPECT_TRUE(lone.may_jump(none, vertices, vertices)) << "nothing is to jump";
    // Out of the box that nothing reaches into.
    vertices = assembly.mesh.vertices;
    for (Vec3& v : vertices) {
        v.x += 20.0;
    }
    EXPECT_FALSE(first_may_jump(lone, assembly.mesh.vertices, vertices));
}

/// The vertices of one body of four fish.
std::span<Vec3> surface_of(const Assembly& assembly, std::size_t body, std::vector<Vec3>& vertices) {
    const Skinner::Part part = assembly.part(body);
    return std::span(vertices).subspan(part.first_vertex, part.vertices);
}

TEST(LoneSurfaces, AreAloneWithWhatReachesIntoTheirBox) {
    const Assembly assembly(test::scene_with("four-fish"));
    LoneSurfaces lone(assembly);
    // The first three in a row; the fourth is off it.
    for (std::size_t b = 0; b < 4; ++b) {
        const double x = b == 3 ? 9.0 : 0.9 * static_cast<double>(b);
        lone.rooms()[b] = {Vec3(x, 0.0, 0.0), Vec3(x + 1.0, 1.0, 1.0)};
    }
    EXPECT_TRUE(lone.is_alone(0, kFarTool));
    EXPECT_TRUE(std::ranges::equal(lone.group(), std::vector<std::uint8_t>{1, 1, 1, 0}));
    EXPECT_TRUE(lone.is_alone(3, {{Vec3(0.0), Vec3(1.0)}, {}}));
    EXPECT_FALSE(lone.is_alone(0, {{Vec3(2.7, 0.0, 0.0), Vec3(3.0)}, {}}))
        << "the tool reaches into the box of the third";
    // In a corner of the box around them, which touches none of them.
    lone.rooms()[1] = {Vec3(0.9, 0.0, 0.0), Vec3(1.9, 4.0, 1.0)};
    EXPECT_FALSE(lone.is_alone(0, {{Vec3(0.0, 3.0, 0.0), Vec3(0.5, 3.5, 0.5)}, {}}));
}

TEST(LoneSurfaces, AreAloneWithAToolThatIsABall) {
    const Assembly assembly(test::scene_with("four-fish"));
    LoneSurfaces lone(assembly);
    for (std::size_t b = 0; b < 4; ++b) {
        const double x = 2.0 * static_cast<double>(b);
        lone.rooms()[b] = {Vec3(x, 0.0, 0.0), Vec3(x + 1.0, 1.0, 1.0)};
    }
    const Aabb reach{Vec3(0.5), Vec3(0.7)};
    EXPECT_FALSE(lone.is_alone(0, {reach, {}})) << "a hand, which may hold a body in a ring of its fingers";
    EXPECT_TRUE(lone.is_alone(0, {reach, Ball{Vec3(0.6), 0.1}}));
    EXPECT_TRUE(std::ranges::equal(lone.group(), std::vector<std::uint8_t>{1, 0, 0, 0}));
    // The box has to hold the ball too, and so reaches into the room of the next one.
    EXPECT_TRUE(lone.is_alone(0, {{Vec3(0.9), Vec3(2.5)}, Ball{Vec3(1.7), 0.1}}));
    EXPECT_TRUE(std::ranges::equal(lone.group(), std::vector<std::uint8_t>{1, 1, 0, 0}));
}

TEST(LoneSurfaces, JumpPastTheToolOnlyWhereItIsBesideThem) {
    const Assembly assembly(test::scene_with("fish-grab"));
    LoneSurfaces lone(assembly);
    const std::vector<Vec3>& fish = assembly.mesh.vertices;
    const auto moved = [&](const Vec3& way) {
        std::vector<Vec3> vertices = fish;
        for (Vec3& v : vertices) {
            v += way;
        }
        return vertices;
    };
    const auto tool_at = [](const Vec3& centre) {
        return LoneTool{{centre - Vec3(0.01), centre + Vec3(0.01)}, Ball{centre, 0.008}};
    };
    Vec3 middle(0.0);
    for (const Vec3& v : fish) {
        middle += v / static_cast<double>(fish.size());
    }
    // Past it, from one side to the other.
    const LoneTool above = tool_at(middle + Vec3(0.0, 0.2, 0.0));
    EXPECT_TRUE(first_may_jump(lone, fish, moved({0.0, 0.4, 0.0}), above));
    // To where the tool is, in the fish as a whole or in its side.
    EXPECT_FALSE(first_may_jump(lone, fish, moved({0.0, 0.2, 0.0}), above));
    const auto side = std::ranges::max_element(fish, {}, [](const Vec3& v) { return v.z; });
    const LoneTool beside = tool_at(*side + Vec3(0.0, 0.0, 0.2));
    EXPECT_FALSE(first_may_jump(lone, fish, moved({0.0, 0.0, 0.193}), beside));
    EXPECT_TRUE(first_may_jump(lone, fish, moved({0.0, 0.0, 0.191}), beside));
    // From where it is.
    EXPECT_FALSE(first_may_jump(lone, fish, moved({0.0, 0.4, 0.0}), tool_at(middle)));
}

TEST(LoneSurfaces, AreNotAloneWithASheet) {
    const Assembly assembly(test::scene_with("curtain-hand"));
    LoneSurfaces lone(assembly);
    for (std::size_t b = 0; b < assembly.bodies.size(); ++b) {
        EXPECT_FALSE(lone.is_alone(b, kFarTool));
    }
}

TEST(LoneSurfaces, JumpInAGroupUnlessTheyMeetOneAnother) {
    const Assembly assembly(test::scene_with("four-fish"));
    LoneSurfaces lone(assembly);
    for (Aabb& room : lone.rooms()) {
        room = kWide;
    }
    ASSERT_TRUE(lone.is_alone(0, kFarTool));
    // One beside the other, 1 m apart.
    std::vector<Vec3> vertices = assembly.mesh.vertices;
    for (std::size_t b = 0; b < 4; ++b) {
        for (Vec3& v : surface_of(assembly, b, vertices)) {
            v.z += static_cast<double>(b);
        }
    }
    std::vector<std::uint8_t> jumps = {1, 1, 0, 1};
    EXPECT_TRUE(lone.may_jump(jumps, vertices, vertices));
    EXPECT_TRUE(std::ranges::equal(jumps, std::vector<std::uint8_t>{1, 1, 0, 1}));
    // The second through the third, which does not jump.
    std::vector<Vec3> crossing = vertices;
    const Vec3 way = surface_of(assembly, 2, crossing)[0] - surface_of(assembly, 1, crossing)[0] + Vec3(0.005);
    for (Vec3& v : surface_of(assembly, 1, crossing)) {
        v += way;
    }
    EXPECT_FALSE(lone.may_jump(jumps, vertices, crossing));
    EXPECT_TRUE(std::ranges::equal(jumps, std::vector<std::uint8_t>{1, 0, 0, 1}));
    EXPECT_TRUE(lone.may_jump(jumps, vertices, crossing)) << "the others may";
    // The second within the third: they do not cross.
    std::vector<Vec3> nested = vertices;
    Vec3 middle(0.0);
    const std::span<Vec3> third = surface_of(assembly, 2, nested);
    for (const Vec3& v : third) {
        middle += v / static_cast<double>(third.size());
    }
    for (Vec3& v : surface_of(assembly, 1, nested)) {
        v = middle + 0.01 * (v - Vec3(0.0, 0.0, 1.0));
    }
    jumps = {1, 1, 1, 1};
    EXPECT_FALSE(lone.may_jump(jumps, vertices, nested));
    EXPECT_TRUE(std::ranges::equal(jumps, std::vector<std::uint8_t>{1, 0, 0, 1}));
}

TEST(LoneSurfaces, AreNotAloneWithWhatIsWithinThem) {
    Assembly assembly(test::scene_with("four-fish"));
    const auto is_alone = [&](std::size_t body) {
        LoneSurfaces lone(assembly);
        for (std::size_t b = 0; b < 4; ++b) {
            lone.rooms()[b] = {Vec3(static_cast<double>(b)), Vec3(static_cast<double>(b) + 0.5)};
        }
        return lone.is_alone(body, kFarTool);
    };
    EXPECT_TRUE(is_alone(0));
    // The second shrinks into the middle of the first.
    Vec3 middle(0.0);
    const std::span<Vec3> first = surface_of(assembly, 0, assembly.mesh.vertices);
    for (const Vec3& v : first) {
        middle += v / static_cast<double>(first.size());
    }
    for (Vec3& v : surface_of(assembly, 1, assembly.mesh.vertices)) {
        v = middle + 0.01 * (v - middle);
    }
    EXPECT_FALSE(is_alone(0));
    EXPECT_FALSE(is_alone(1));
    EXPECT_TRUE(is_alone(2));
}

TEST(LoneSurfaces, AreDrawnInByNoMoreThanTheyLag) {
    const Assembly assembly(test::scene_with("fish-grab"));
    const LoneSurfaces lone(assembly);
    const std::vector<Vec3>& skin = assembly.mesh.vertices;
    const auto farthest = [&](double lag) {
        std::vector<Vec3> drawn = skin;
        lone.draw_in(0, lag, drawn);
        double most = 0.0;
        for (std::size_t v = 0; v < skin.size(); ++v) {
            most = std::max(most, glm::length(drawn[v] - skin[v]));
        }
        return most;
    };
    EXPECT_EQ(farthest(0.0), 0.0);
    EXPECT_NEAR(farthest(0.0004), 0.0002, 1e-12);
    EXPECT_GT(farthest(0.1), 0.001);
    EXPECT_LT(farthest(0.1), 0.004);
}

TEST(LoneSurfaces, AreTestedWhileTheyLagWithoutCatchingUp) {
    const Assembly assembly(test::scene_with("fish-grab"));
    LoneSurfaces lone(assembly);
    const auto tests_in_a_second = [&](const auto& lag_at) {
        int tests = 0;
        for (int k = 1; k <= 64; ++k) {
            if (lone.end_step(0, lag_at(k), 1.0 / 64.0)) {
                lone.begin_test(0, false);
                ++tests;
            }
        }
        return tests;
    };
    EXPECT_EQ(tests_in_a_second([](int) { return 0.001; }), 3);
    EXPECT_EQ(tests_in_a_second([](int k) { return 0.001 * std::pow(0.99, k); }), 0);
    EXPECT_EQ(tests_in_a_second([](int k) { return k % 16 == 0 ? 0.0 : 0.001; }), 0);
    EXPECT_EQ(tests_in_a_second([](int) { return 0.0004; }), 0) << "as in any heap";
    // A jump that has not helped for long is not tried again soon.
    EXPECT_EQ(tests_in_a_second([](int) { return 0.001; }), 3);
    lone.note_jump(0);
    EXPECT_EQ(tests_in_a_second([](int) { return 0.001; }), 0);
    EXPECT_FALSE(lone.end_step(0, 0.0, 0.01));
    EXPECT_EQ(tests_in_a_second([](int) { return 0.001; }), 3);
}

TEST(LoneSurfaces, NeedNotWaitOnceTheyHaveBeenAloneForAWhile) {
    const Assembly assembly(test::scene_with("fish-grab"));
    LoneSurfaces lone(assembly);
    for (const bool alone : {true, true, false, true, true}) {
        lone.begin_test(0, alone);
        EXPECT_FALSE(lone.need_not_wait(0));
    }
    lone.begin_test(0, true);
    EXPECT_TRUE(lone.need_not_wait(0));
    EXPECT_FALSE(lone.end_step(0, 0.0, 0.01));
    EXPECT_FALSE(lone.need_not_wait(0)) << "it lags no more";
}

}  // namespace
}  // namespace haptic::sim
