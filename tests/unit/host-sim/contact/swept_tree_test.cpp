#include "contact/swept_tree.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include "contact/oracle.hpp"
#include "contact/scenes.hpp"

namespace {

using haptic::Vec3;
using haptic::sim::Aabb;
using haptic::sim::Faces;
using haptic::sim::SweptTree;
using haptic::sim::Triangle;
using haptic::sim::TriangleMesh;
using haptic::sim::oracle::Random;

bool meets(const Aabb& a, const Vec3& low, const Vec3& high) {
    for (int k = 0; k < 3; ++k) {
        if (a.min[k] > high[k] || a.max[k] < low[k]) {
            return false;
        }
    }
    return true;
}

class OfSize : public testing::TestWithParam<std::uint32_t> {};

TEST_P(OfSize, FindsEveryTriangleWhoseSweptBoxMeetsTheQuery) {
    Random random(GetParam());
    const TriangleMesh mesh = haptic::sim::scenes::sheet(1.0, GetParam(), true);
    SweptTree tree(mesh.vertices, mesh.triangles, Faces::All);
    std::size_t visited = 0;
    for (int round = 0; round < 5; ++round) {
        std::vector<Vec3> start;
        std::vector<Vec3> end;
        for (const Vec3& v : mesh.vertices) {
            start.push_back(v + random.in_cube(0.05));
            end.push_back(v + random.in_cube(0.05) + Vec3(0, -0.1, 0.02));
        }
        tree.refit({start, end, mesh.triangles});
        for (int k = 0; k < 40; ++k) {
            const Aabb box =
                haptic::sim::aabb_of_segment(random.in_cube(0.6), random.in_cube(0.6), random.uniform(0, 0.1));
            std::multiset<std::uint32_t> found;
            tree.query(box, [&](std::uint32_t t) { found.insert(t); });
            visited += found.size();
            for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
                Vec3 low(1e300);
                Vec3 high(-1e300);
                for (const std::uint32_t v : mesh.triangles[t]) {
                    low = glm::min(low, glm::min(start[v], end[v]));
                    high = glm::max(high, glm::max(start[v], end[v]));
                }
                ASSERT_LE(found.count(t), 1u) << "visited twice";
                if (meets(box, low, high)) {
                    ASSERT_EQ(found.count(t), 1u) << "triangle " << t;
                }
                for (int axis = 0; axis < 3; ++axis) {
                    ASSERT_LE(tree.bounds().min[axis], low[axis]);
                    ASSERT_GE(tree.bounds().max[axis], high[axis]);
                }
            }
        }
    }
    EXPECT_GT(visited, 0u);
}

INSTANTIATE_TEST_SUITE_P(Sheets, OfSize, testing::Values(1u, 2u, 3u, 5u, 9u, 14u));

TEST(SweptTree, FindsEachTwoLeavesWhoseBoxesMeetOnce) {
    Random random(11);
    const TriangleMesh mesh = haptic::sim::scenes::sheet(1.0, 14, true);
    SweptTree one(mesh.vertices, mesh.triangles, Faces::All);
    SweptTree other(mesh.vertices, mesh.triangles, Faces::Single);
    const auto refit = [&](SweptTree& tree, const Vec3& offset) {
        std::vector<Vec3> start;
        std::vector<Vec3> end;
        for (const Vec3& v : mesh.vertices) {
            start.push_back(offset + v + random.in_cube(0.05));
            end.push_back(offset + v + random.in_cube(0.05) + Vec3(0, -0.1, 0.02));
        }
        tree.refit({start, end, mesh.triangles});
    };
    for (const double apart : {0.0, 0.1, 0.16, 0.3, 3.0}) {
        refit(one, Vec3(0.0));
        refit(other, Vec3(0.3, apart, 0.1));
        for (const double margin : {0.0, 0.05}) {
            std::multiset<std::pair<std::uint32_t, std::uint32_t>> found;
            one.query_pairs(other, margin,
                            [&](std::uint32_t leaf, std::uint32_t of_other) { found.insert({leaf, of_other}); });
            std::multiset<std::pair<std::uint32_t, std::uint32_t>> expected;
            for (std::uint32_t a = 0; a < one.leaf_count(); ++a) {
                for (std::uint32_t b = 0; b < other.leaf_count(); ++b) {
                    const Aabb box = haptic::sim::grown(one.box_of_leaf(a), margin);
                    if (meets(box, other.box_of_leaf(b).min, other.box_of_leaf(b).max)) {
                        expected.insert({a, b});
                    }
                }
            }
            EXPECT_EQ(found, expected) << apart;
        }
    }
    // A surface without triangles meets nothing.
    const SweptTree none({}, {});
    none.query_pairs(one, 1.0, [](std::uint32_t, std::uint32_t) { ADD_FAILURE(); });
    one.query_pairs(none, 1.0, [](std::uint32_t, std::uint32_t) { ADD_FAILURE(); });
}

TEST(SweptTree, VisitsFewOfManyTriangles) {
    const TriangleMesh mesh = haptic::sim::scenes::sheet(1.0, 32, true);
    SweptTree tree(mesh.vertices, mesh.triangles, Faces::All);
    tree.refit({mesh.vertices, mesh.vertices, mesh.triangles});
    std::size_t visited = 0;
    tree.query(haptic::sim::aabb_of_segment({0.1, 0, 0.1}, {0.1, 0, 0.1}, 0.03), [&](std::uint32_t) { ++visited; });
    EXPECT_GE(visited, 16u);
    EXPECT_LT(visited, 160u) << "of 4096";
    EXPECT_EQ(tree.leaf_count(), 512u);
}

TEST(SweptTree, HoldsTheFirstOfTheTrianglesWithTheSameVertices) {
    // A double-faced sheet with its triangles reversed: the first of each pair now is a back face.
    TriangleMesh mesh = haptic::sim::scenes::sheet(1.0, 9, true);
    std::reverse(mesh.triangles.begin(), mesh.triangles.end());
    SweptTree tree(mesh.vertices, mesh.triangles);
    tree.refit({mesh.vertices, mesh.vertices, mesh.triangles});
    std::set<std::uint32_t> found;
    tree.query(haptic::sim::aabb_of_segment({0, 0, 0}, {0, 0, 0}, 9.0), [&](std::uint32_t t) { found.insert(t); });
    // Oracle: every triangle with all earlier ones.
    std::set<std::uint32_t> first;
    for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
        const bool repeats =
            std::any_of(mesh.triangles.begin(), mesh.triangles.begin() + t, [&](const Triangle& other) {
                return std::is_permutation(other.begin(), other.end(), mesh.triangles[t].begin());
            });
        if (!repeats) {
            first.insert(t);
        }
    }
    EXPECT_EQ(first.size(), 162u);
    EXPECT_EQ(found, first);
}

TEST(SweptTree, KnowsTheExtremesOfTheMotion) {
    const TriangleMesh mesh = haptic::sim::scenes::sheet(1.0, 3, false);
    SweptTree tree(mesh.vertices, mesh.triangles);
    std::vector<Vec3> end = mesh.vertices;
    end[0] += Vec3(0.1, 0, -0.2);
    end[5] += Vec3(-0.3, 0, 0.4);
    tree.refit({mesh.vertices, end, mesh.triangles});
    EXPECT_NEAR(glm::length(tree.displacement().min - Vec3(-0.3, 0, -0.2)), 0.0, 1e-15);
    EXPECT_NEAR(glm::length(tree.displacement().max - Vec3(0.1, 0, 0.4)), 0.0, 1e-15);
}

TEST(SweptTree, LeavesVerticesOfNoTriangleOutOfTheMotion) {
    TriangleMesh mesh = haptic::sim::scenes::sheet(1.0, 3, false);
    mesh.vertices.emplace_back(0.0, 0.0, 0.0);
    SweptTree tree(mesh.vertices, mesh.triangles);
    std::vector<Vec3> end = mesh.vertices;
    end.back() += Vec3(0.0, 7.0, 0.0);
    tree.refit({mesh.vertices, end, mesh.triangles});
    EXPECT_EQ(tree.displacement().max, Vec3(0.0));
    EXPECT_EQ(tree.bounds().max.y, 0.0);
}

TEST(SweptTree, FindsNothingBeforeTheFirstRefit) {
    const TriangleMesh mesh = haptic::sim::scenes::sheet(1.0, 3, false);
    const SweptTree tree(mesh.vertices, mesh.triangles);
    tree.query(haptic::sim::aabb_of_segment({0, 0, 0}, {0, 0, 0}, 9.0), [](std::uint32_t) { FAIL(); });
}

TEST(SweptTree, HasTheSameBoxesWhateverRegistersThereAre) {
    Random random(3);
    for (const std::uint32_t cells : {1u, 3u, 14u}) {
        const TriangleMesh mesh = haptic::sim::scenes::sheet(1.0, cells, cells != 3u);
        SweptTree wide(mesh.vertices, mesh.triangles);
        SweptTree narrow(mesh.vertices, mesh.triangles);
        std::vector<Vec3> end;
        for (const Vec3& v : mesh.vertices) {
            end.push_back(v + random.in_cube(0.05));
        }
        wide.refit({mesh.vertices, end, mesh.triangles});
        narrow.refit({mesh.vertices, end, mesh.triangles}, false);
        EXPECT_EQ(wide.bounds().min, narrow.bounds().min);
        EXPECT_EQ(wide.bounds().max, narrow.bounds().max);
        EXPECT_EQ(wide.displacement().min, narrow.displacement().min);
        EXPECT_EQ(wide.displacement().max, narrow.displacement().max);
        for (int k = 0; k < 100; ++k) {
            const Aabb box = haptic::sim::aabb_of_segment(random.in_cube(0.6), random.in_cube(0.6), 0.01);
            std::vector<std::uint32_t> a;
            std::vector<std::uint32_t> b;
            wide.query(box, [&](std::uint32_t t) { a.push_back(t); });
            narrow.query(box, [&](std::uint32_t t) { b.push_back(t); });
            ASSERT_EQ(a, b);
        }
    }
}

TEST(SweptTree, HoldsForASurfaceThatCameToRest) {
    Random random(12);
    haptic::sim::scenes::World refitted;
    haptic::sim::scenes::World left_alone;
    for (haptic::sim::scenes::World* world : {&refitted, &left_alone}) {
        haptic::sim::scenes::Body& floor = world->add(haptic::sim::scenes::sheet(1.0, 16, true));
        floor.start = haptic::sim::scenes::placed(floor.mesh.vertices, haptic::Mat3(1.0), {0, 0.2, 0});
        world->refit();
        floor.stay();
        world->refit();
    }
    Vec3 proxy(0.0, 0.04, 0.0);
    int touching = 0;
    for (int k = 0; k < 200; ++k) {
        refitted.refit();
        const Vec3 hip(random.uniform(-0.4, 0.4), random.uniform(-0.05, 0.05), 0.0);
        const auto one = step(refitted, proxy, hip, 0.03);
        const auto other = step(left_alone, proxy, hip, 0.03);
        ASSERT_EQ(one.moved.position, other.moved.position) << k;
        ASSERT_TRUE(other.crossings.empty()) << k;
        touching += other.moved.contacts.count > 0 ? 1 : 0;
        proxy = other.moved.position;
    }
    EXPECT_GT(touching, 100);
}

TEST(SweptTree, TakesAMeshWithoutTrianglesAndRefusesAnIndexWithoutVertex) {
    const std::vector<Vec3> vertices{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    SweptTree none(vertices, {});
    none.refit({vertices, vertices, {}});
    none.query(haptic::sim::aabb_of_segment({0, 0, 0}, {0, 0, 0}, 9.0), [](std::uint32_t) { FAIL(); });
    const std::vector<Triangle> bad{{0, 1, 3}};
    EXPECT_THROW(SweptTree(vertices, bad), std::invalid_argument);
}

TEST(SweptTree, TakesManyTrianglesInOnePlace) {
    const std::vector<Vec3> vertices{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    const std::vector<Triangle> pile(1000, Triangle{0, 1, 2});
    SweptTree tree(vertices, pile, Faces::All);
    tree.refit({vertices, vertices, pile});
    std::size_t visited = 0;
    tree.query(haptic::sim::aabb_of_segment({0, 0, 0}, {0, 0, 0}, 0.1), [&](std::uint32_t) { ++visited; });
    EXPECT_EQ(visited, 1000u);
}

}  // namespace
