// Surfaces that are asked to pass through themselves: a slab that is bent into a ring, and on.
#include "collision/own_pairs.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <numbers>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "collision/feature_distance.hpp"
#include "collision/solid_surfaces.hpp"
#include "dynamics/workers.hpp"
#include "haptic/sim/block.hpp"
#include "haptic/sim/collisions.hpp"
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
        solids_->ask(0, start_, end_, kStep);
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
                v += GetParam() * Vec3(uniform(random), uniform(random), uniform(random));
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

}  // namespace
}  // namespace haptic::sim
