// Surfaces that are asked to pass through themselves: a slab that is bent into a ring, and on; and what is found of it.
#include "collision/own_pairs.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <memory>
#include <numbers>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "collision/feature_blocks.hpp"
#include "collision/feature_distance.hpp"
#include "collision/solid_surfaces.hpp"
#include "contact/swept_tree.hpp"
#include "dynamics/rows.hpp"
#include "dynamics/workers.hpp"
#include "haptic/sim/block.hpp"
#include "haptic/sim/collisions.hpp"
#include "simd/kernels.hpp"
#include "verification/surface_crossings.hpp"

namespace haptic::sim {
namespace {

constexpr double kLength = 0.16;  // m
constexpr double kStep = 0.01;    // s
constexpr double kCatchUpSpeed = 0.2;

/// A slab of 160 x 8 x 24 mm.
TriangleMesh slab() {
    return make_block_mesh({.size = {kLength, 0.008, 0.024}, .cells = 20});
}

/// Bent about z by an angle from end to end, rad, and moved on as a whole.
std::vector<Vec3> bent(const TriangleMesh& mesh, double angle, const Vec3& moved = Vec3(0.0)) {
    std::vector<Vec3> vertices;
    for (const Vec3& v : mesh.vertices) {
        if (angle == 0.0) {
            vertices.push_back(v + moved);
            continue;
        }
        const double radius = kLength / angle;
        const double at = v.x / radius;
        vertices.push_back(moved + Vec3(std::sin(at) * (radius - v.y), radius - std::cos(at) * (radius - v.y), v.z));
    }
    return vertices;
}

/// A surface that follows what it is asked to be.
class Surface {
  public:
    Surface(TriangleMesh mesh, std::vector<Vec3> start, int threads = 1,
            std::size_t lanes = ParticleCollisions::kWidest, SurfacesAtStart left_alone = {})
        : mesh_(std::move(mesh)),
          workers_(threads),
          tree_(mesh_.vertices, mesh_.triangles),
          start_(start),
          end_(std::move(start)),
          crossings_({{{mesh_.triangles, 0}}}, end_) {
        tree_.refit({start_, end_, mesh_.triangles});
        solids_ = std::make_unique<SolidSurfaces>(
            std::vector<SolidSurface>{{.tree = &tree_, .triangles = mesh_.triangles, .vertices = end_.size()}}, end_,
            std::move(left_alone), kCatchUpSpeed, lanes);
    }

    void step(const std::vector<Vec3>& asked) {
        start_ = end_;
        asked_ = end_ = asked;
        solids_->ask(0, end_, kStep);
        tree_.refit({start_, end_, mesh_.triangles});
        solids_->keep_apart(start_, end_, workers_);
    }

    [[nodiscard]] const std::vector<Vec3>& end() const { return end_; }
    [[nodiscard]] const SolidSurfaces& solids() const { return *solids_; }
    /// Edges through triangles of the surface, at moments of the way of the last step, with its end.
    [[nodiscard]] std::size_t crossings() {
        std::size_t count = 0;
        for (int moment = 1; moment <= kMoments; ++moment) {
            std::vector<Vec3> at = start_;
            for (std::size_t v = 0; v < at.size(); ++v) {
                at[v] += static_cast<double>(moment) / kMoments * (end_[v] - start_[v]);
            }
            count += crossings_.find(at, 0.0).size();
        }
        return count;
    }
    [[nodiscard]] std::size_t asked_crossings() { return crossings_.find(asked_, 0.0).size(); }
    [[nodiscard]] double lag() const {
        double most = 0.0;
        for (std::size_t v = 0; v < end_.size(); ++v) {
            most = std::max(most, glm::length(end_[v] - asked_[v]));
        }
        return most;
    }
    /// m, the least distance of a vertex and a triangle, or two edges, that share no vertex.
    [[nodiscard]] double least_distance() const {
        double least = 1e9;
        std::set<std::pair<std::uint32_t, std::uint32_t>> edges;
        for (const Triangle& t : mesh_.triangles) {
            for (std::uint32_t v = 0; v < end_.size(); ++v) {
                if (std::ranges::find(t, v) == t.end()) {
                    const FeatureVertices x{end_[v], end_[t[0]], end_[t[1]], end_[t[2]]};
                    least = std::min(least, nearest_points(PairKind::VertexTriangle, x).distance);
                }
            }
            for (std::size_t k = 0; k < 3; ++k) {
                edges.insert(std::minmax({t[k], t[(k + 1) % 3]}));
            }
        }
        for (const auto& [a, b] : edges) {
            for (const auto& [c, d] : edges) {
                if (a < c && b != c && b != d && a != d) {
                    const FeatureVertices x{end_[a], end_[b], end_[c], end_[d]};
                    least = std::min(least, nearest_points(PairKind::EdgeEdge, x).distance);
                }
            }
        }
        return least;
    }

  private:
    static constexpr int kMoments = 8;
    TriangleMesh mesh_;
    Workers workers_;
    SweptTree tree_;
    std::vector<Vec3> start_;
    std::vector<Vec3> end_;
    std::vector<Vec3> asked_;
    SurfaceCrossings crossings_;
    std::unique_ptr<SolidSurfaces> solids_;
};

class BentSurface : public ::testing::TestWithParam<double> {};

TEST_P(BentSurface, NeverPassesThroughItselfAndKeepsTheGap) {
    // From flat to 1.5 turns, so many rad a step, while it flies at 2 m/s.
    const double turn = GetParam();
    const TriangleMesh mesh = slab();
    Surface surface(mesh, mesh.vertices);
    const int steps = static_cast<int>(3.0 * std::numbers::pi / turn);
    std::size_t asked = 0;
    for (int k = 1; k <= steps; ++k) {
        surface.step(bent(mesh, k * turn, {0.02 * k, 0.0, 0.0}));
        asked += surface.asked_crossings();
        ASSERT_EQ(surface.crossings(), 0U) << k;
        if (k % std::max(1, steps / 6) == 0) {
            ASSERT_GE(surface.least_distance(), 0.999 * surface.solids().least_gap()) << k;
        }
    }
    EXPECT_GT(asked, 0U) << "nothing was in the way";
    EXPECT_GT(surface.solids().counts().unsafe, 0U);
    EXPECT_GT(surface.lag(), 0.002);
}

INSTANTIATE_TEST_SUITE_P(Turns, BentSurface, ::testing::Values(0.02, 0.1, 0.5, 2.0));

class ShakenSurface : public ::testing::TestWithParam<double> {};

TEST_P(ShakenSurface, NeverPassesThroughItself) {
    // Each vertex is asked elsewhere in each step, up to so many m away: rounds then lead many of them far.
    const TriangleMesh mesh = slab();
    std::size_t asked = 0;
    for (const std::uint32_t seed : {3U, 4U, 5U}) {
        Surface surface(mesh, mesh.vertices);
        std::mt19937 random(seed);
        std::uniform_real_distribution<double> uniform(-1.0, 1.0);
        for (int k = 1; k <= 60; ++k) {
            std::vector<Vec3> at = bent(mesh, 0.15 * k);
            for (Vec3& v : at) {
                v += GetParam() * Vec3{uniform(random), uniform(random), uniform(random)};
            }
            surface.step(at);
            asked += surface.asked_crossings();
            ASSERT_EQ(surface.crossings(), 0U) << seed << " " << k;
        }
    }
    EXPECT_GT(asked, GetParam() < 0.006 ? 10U : 1000U);
}

INSTANTIATE_TEST_SUITE_P(Ways, ShakenSurface, ::testing::Values(0.001, 0.003, 0.006, 0.012));

TEST(OwnPairs, ASurfaceThatBendsWithinItsRoomGoesWhereItIsAsked) {
    const TriangleMesh mesh = slab();
    Surface surface(mesh, mesh.vertices);
    for (int k = 1; k <= 55; ++k) {
        const std::vector<Vec3> asked = bent(mesh, 0.1 * k, {0.3 * k, 0.0, 0.0});
        surface.step(asked);
        ASSERT_EQ(surface.end(), asked) << k;
    }
    EXPECT_EQ(surface.solids().counts().unsafe, 0U);
}

TEST(OwnPairs, ASurfaceFollowsAgainAsSoonAsThereIsRoom) {
    const TriangleMesh mesh = slab();
    Surface surface(mesh, mesh.vertices);
    for (int k = 1; k <= 75; ++k) {
        surface.step(bent(mesh, 0.1 * k));
    }
    EXPECT_GT(surface.lag(), 0.002);
    for (int k = 74; k >= -20; --k) {
        surface.step(bent(mesh, 0.1 * std::max(0, k)));
        ASSERT_EQ(surface.crossings(), 0U) << k;
    }
    EXPECT_EQ(surface.lag(), 0.0);
}

TEST(OwnPairs, WhatCrossesOrTouchesAtTheStartIsLeftAloneAndTheRestIsNot) {
    // Both ends lie in one another at the start; later its middle is folded, too.
    const TriangleMesh mesh = slab();
    const std::vector<Vec3> start = bent(mesh, 6.6);
    SurfaceCrossings at_start({{{mesh.triangles, 0}}}, start);
    SurfacesAtStart left_alone;
    for (const SurfaceCrossing& c : at_start.find(start, 0.0)) {
        const Triangle& t = mesh.triangles[c.triangle];
        left_alone.vertices.insert(left_alone.vertices.end(), {c.edge[0], c.edge[1], t[0], t[1], t[2]});
    }
    ASSERT_FALSE(left_alone.vertices.empty());
    Surface surface(mesh, start, 1, ParticleCollisions::kWidest, left_alone);
    const auto crossings_of_others = [&] {
        const auto found = at_start.find(surface.end(), 0.0);
        return std::ranges::count_if(found, [&](const SurfaceCrossing& c) {
            const Triangle& t = mesh.triangles[c.triangle];
            const auto alone = [&](std::uint32_t v) { return surface.solids().leaves_alone(v); };
            const auto of_edge = std::ranges::count_if(c.edge, alone);
            const auto of_triangle = std::ranges::count_if(t, alone);
            // Past an edge of the triangle, or an end of the edge.
            return !(of_edge == 2 && of_triangle >= 2) && !(of_edge >= 1 && of_triangle == 3);
        });
    };
    for (int k = 1; k <= 40; ++k) {
        surface.step(bent(mesh, 6.6 + 0.1 * k));
        ASSERT_EQ(crossings_of_others(), 0) << k;
    }
    EXPECT_GT(surface.asked_crossings(), 0U);
}

TEST(OwnPairs, HaveTheSameBitsWithAnyNumberOfLanesAndThreads) {
    const TriangleMesh mesh = slab();
    const auto ends = [&](int threads, std::size_t lanes) {
        Surface surface(mesh, mesh.vertices, threads, lanes);
        for (int k = 1; k <= 80; ++k) {
            surface.step(bent(mesh, 0.1 * k));
        }
        return surface.end();
    };
    const std::vector<Vec3> expected = ends(1, ParticleCollisions::kWidest);
    for (const std::size_t lanes : ParticleCollisions::usable_lanes()) {
        EXPECT_EQ(ends(2, lanes), expected) << lanes;
    }
}

/// What is found of a surface, as SurfacePairs finds it.
class FoundPairs {
  public:
    explicit FoundPairs(const TriangleMesh& mesh)
        : mesh_(mesh), kernels_(widest_kernels()), blocks_(kernels_.colliders), at_(rows_of(mesh.vertices)) {
        const SweptTree tree(mesh.vertices, mesh.triangles);
        std::vector<Triangle> triangles;
        std::vector<std::uint32_t> in_block;
        for (std::uint32_t leaf = 0; leaf < tree.leaf_count(); ++leaf) {
            for (const std::uint32_t t : tree.triangles_of(leaf)) {
                triangles.push_back(mesh.triangles[t]);
            }
            in_block.push_back(static_cast<std::uint32_t>(tree.triangles_of(leaf).size()));
        }
        blocks_.add_surface(triangles, in_block);
        blocks_.make_boxes();
        pairs_ = std::make_unique<OwnPairs>(blocks_, kernels_.deformation, kEdge);
    }

    /// Takes a motion, and then others of a few of the vertices, before it is made.
    void step(const std::vector<Vec3>& to, const std::vector<std::uint32_t>& moved, const std::vector<Vec3>& then) {
        std::vector<Row> end = rows_of(to);
        pairs_->take_motion(blocks_, at_.data(), end.data(), kApart);
        find(end);
        expect_all(end, [](std::uint32_t) { return true; });
        if (!moved.empty()) {
            for (const std::uint32_t v : moved) {
                end[v] = row_of(then[v]);
            }
            pairs_->take_motion_of(moved, blocks_, end.data(), kApart);
            find(end);
            expect_all(end, [&](std::uint32_t v) { return std::ranges::find(moved, v) != moved.end(); });
        }
        pairs_->advance();
        at_ = end;
    }
    [[nodiscard]] std::size_t near() const { return near_; }
    [[nodiscard]] std::size_t lists() const { return lists_; }
    [[nodiscard]] std::size_t compared() const { return compared_; }

    static constexpr double kEdge = 0.0095;
    static constexpr double kApart = kEdge / 64.0;

  private:
    static std::vector<Row> rows_of(const std::vector<Vec3>& points) {
        std::vector<Row> rows;
        for (const Vec3& x : points) {
            rows.push_back(row_of(x));
        }
        return rows;
    }
    static FeatureVertices places(const PairVertices& v, const std::vector<Row>& at) {
        return {vector_of(at[v[0]]), vector_of(at[v[1]]), vector_of(at[v[2]]), vector_of(at[v[3]])};
    }

    /// All pairs that are due, or that a comparison of fast surroundings finds.
    void find(const std::vector<Row>& end) {
        found_.clear();
        pairs_->find(kApart, due_);
        const auto each = [&](std::uint32_t block, const Vec3& margin, bool moves, const auto& visit) {
            FeatureBlocks::Comparison comparison;
            for (const std::uint32_t near : pairs_->near(block)) {
                for (const std::uint32_t k : {block, near}) {
                    blocks_.fit(k, [&](std::uint32_t v) {
                        const Vec3 from = vector_of(at_[v]);
                        return VertexPath{
                            .start = from, .way = moves ? vector_of(end[v]) - from : Vec3(0.0), .margin = margin};
                    });
                }
                blocks_.compare(block, near, comparison);
            }
            visit_all(comparison.candidates, visit);
        };
        for (const std::uint32_t block : pairs_->to_list()) {
            ++lists_;
            pairs_->begin_list(block, blocks_);
            const auto list = [&](PairKind kind, const PairVertices& v) {
                pairs_->list(kind, v, nearest_points(kind, places(v, at_)).distance);
            };
            if (pairs_->is_complete(block)) {
                std::array<PairCandidates, 2> listed;
                pairs_->take_listed(block, listed);
                visit_all(listed, list);
            } else {
                each(block, Vec3(0.5 * pairs_->reach()), false, list);
            }
            pairs_->end_list(block, blocks_, kApart, due_);
        }
        const auto add = [&](PairKind, const PairVertices& v) { found_.insert(v); };
        visit_all({due_[0].pairs, due_[1].pairs}, add);
        for (const std::uint32_t block : pairs_->to_compare()) {
            ++compared_;
            each(block, Vec3(0.5 * kApart), true, add);
        }
    }
    template <class Visit>
    static void visit_all(const std::array<PairCandidates, 2>& candidates, const Visit& visit) {
        for (std::size_t kind = 0; kind < 2; ++kind) {
            const PairCandidates::Vertices of = candidates[kind].vertices();
            for (std::size_t k = 0; k < candidates[kind].size(); ++k) {
                visit(kind == 0 ? PairKind::VertexTriangle : PairKind::EdgeEdge,
                      PairVertices{of[0][k], of[1][k], of[2][k], of[3][k]});
            }
        }
    }

    /// Of all pairs that have a vertex of interest, those that come too near on the way have been found.
    template <class IsOfInterest>
    void expect_all(const std::vector<Row>& end, const IsOfInterest& is_of_interest) {
        const auto check = [&](PairKind kind, const PairVertices& v) {
            if (std::ranges::none_of(v, is_of_interest)) {
                return;
            }
            const FeatureVertices from = places(v, at_);
            const FeatureVertices to = places(v, end);
            // Only those whose middles are near can be.
            for (const double part : {0.5, 1.0}) {
                FeatureVertices x = from;
                for (std::size_t k = 0; k < 4; ++k) {
                    x[k] += part * (to[k] - from[k]);
                }
                // On the way they only must not meet.
                const double least = part < 1.0 ? 0.1 * kApart : kApart;
                const Vec3 middles = kind == PairKind::VertexTriangle ? x[0] - (x[1] + x[2] + x[3]) / 3.0
                                                                      : 0.5 * (x[0] + x[1] - x[2] - x[3]);
                if (glm::dot(middles, middles) < 9.0 * kEdge * kEdge && nearest_points(kind, x).distance < least) {
                    ++near_;
                    EXPECT_TRUE(found_.contains(v) || found_.contains(PairVertices{v[2], v[3], v[0], v[1]}))
                        << v[0] << " " << v[1] << " " << v[2] << " " << v[3] << " at " << part;
                }
            }
        };
        for (const Triangle& t : blocks_.triangles()) {
            for (const std::uint32_t v : blocks_.vertices()) {
                if (std::ranges::find(t, v) == t.end()) {
                    check(PairKind::VertexTriangle, {v, t[0], t[1], t[2]});
                }
            }
        }
        const auto edges = blocks_.edges();
        for (std::size_t a = 0; a < edges.size(); ++a) {
            for (std::size_t b = 0; b < a; ++b) {
                if (std::ranges::find_first_of(edges[a], edges[b]) == edges[a].end()) {
                    check(PairKind::EdgeEdge, {edges[b][0], edges[b][1], edges[a][0], edges[a][1]});
                }
            }
        }
    }

    TriangleMesh mesh_;
    const Kernels& kernels_;
    FeatureBlocks blocks_;
    std::vector<Row> at_;
    std::unique_ptr<OwnPairs> pairs_;
    std::array<OwnPairs::Due, 2> due_;
    std::set<PairVertices> found_;
    std::size_t near_ = 0;
    std::size_t lists_ = 0;
    std::size_t compared_ = 0;
};

/// How a slab is bent and shaken from step to step.
struct Motions {
    const char* name;
    double turn;   // rad, of its bend, in a step
    double shake;  // m, of each vertex
    double spin;   // rad, of all of it, in a step
};

class PairsOfAMovingSurface : public ::testing::TestWithParam<Motions> {};

TEST_P(PairsOfAMovingSurface, AreAllFoundThatComeNear) {
    // It is bent to and fro, into itself and out again; in between it rests, or a few vertices are led elsewhere.
    const TriangleMesh mesh = slab();
    const Motions& of = GetParam();
    FoundPairs pairs(mesh);
    std::mt19937 random(11);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    const auto shaken = [&](std::vector<Vec3> at, double turn) {
        const Quat rotation = glm::angleAxis(turn, glm::normalize(Vec3(1.0, 2.0, 0.5)));
        for (Vec3& x : at) {
            x = rotation * (x + of.shake * Vec3{uniform(random), uniform(random), uniform(random)});
        }
        return at;
    };
    constexpr int kSteps = 48;
    for (int k = 1; k <= kSteps && !::testing::Test::HasFailure(); ++k) {
        const double bend = 7.0 * std::sin(of.turn * k);
        const std::vector<Vec3> to = shaken(bent(mesh, bend, {0.01 * k, 0.0, 0.0}), of.spin * k);
        std::vector<std::uint32_t> moved;
        for (std::uint32_t v = 0; k % 3 == 0 && v < mesh.vertices.size(); v += 29) {
            moved.push_back(v);
        }
        std::vector<Vec3> then = to;
        for (const std::uint32_t v : moved) {
            then[v] += 0.5 * FoundPairs::kEdge * Vec3{uniform(random), uniform(random), uniform(random)};
        }
        pairs.step(to, moved, then);
    }
    EXPECT_GT(pairs.near(), 100U);
    EXPECT_GT(of.shake < 1e-3 && of.spin < 1.0 ? pairs.lists() : pairs.compared(), 0U);
}

INSTANTIATE_TEST_SUITE_P(Ways, PairsOfAMovingSurface,
                         ::testing::Values(Motions{"Slow", 0.03, 0.0, 0.02}, Motions{"Fast", 0.2, 0.0, 0.3},
                                           Motions{"Shaken", 0.05, 3e-4, 0.1}, Motions{"Torn", 0.1, 3e-3, 0.0},
                                           Motions{"Spinning", 0.05, 0.0, 2.0}),
                         [](const auto& motions) { return motions.param.name; });

}  // namespace
}  // namespace haptic::sim
