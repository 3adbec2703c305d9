#include "collision/surface_features.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <glm/common.hpp>
#include <random>
#include <set>
#include <stdexcept>
#include <vector>

#include "haptic/sim/cloth.hpp"
#include "haptic/sim/collisions.hpp"

namespace haptic::sim {
namespace {

using FeaturePair = std::array<std::uint32_t, 5>;  // kind, then vertices

/// Two cloths, the second with particles behind those of the first.
class TwoCloths : public ::testing::TestWithParam<std::uint32_t> {
  protected:
    TwoCloths()
        : mesh(make_cloth_mesh({.vertices_per_side = GetParam()})),
          surfaces{{.first_particle = 0, .triangles = mesh.triangles, .rest = mesh.vertices},
                   {.first_particle = static_cast<std::uint32_t>(mesh.vertices.size()),
                    .triangles = mesh.triangles,
                    .rest = mesh.vertices}} {}
    TriangleMesh mesh;
    std::vector<ParticleSurface> surfaces;
};

struct Box {
    Vec3 low{1e300};
    Vec3 high{-1e300};
};

bool meet(const Box& a, const Box& b) {
    return glm::all(glm::lessThanEqual(a.low, b.high)) && glm::all(glm::lessThanEqual(b.low, a.high));
}

/// Where vertices may be at a part of their paths.
Box around(std::span<const VertexPath> path, std::span<const std::uint32_t> vertices, double part) {
    Box all;
    for (const std::uint32_t v : vertices) {
        const Vec3 at = path[v].start + part * path[v].way;
        all = {glm::min(all.low, at - path[v].margin), glm::max(all.high, at + path[v].margin)};
    }
    return all;
}

/// Vertices of each feature in rising order, and those of edges by their first.
FeaturePair sorted(PairKind kind, std::array<std::uint32_t, 4> v) {
    if (kind == PairKind::VertexTriangle) {
        std::sort(v.begin() + 1, v.end());
    } else {
        std::sort(v.begin(), v.begin() + 2);
        std::sort(v.begin() + 2, v.end());
        if (v[2] < v[0]) {
            std::rotate(v.begin(), v.begin() + 2, v.end());
        }
    }
    return {static_cast<std::uint32_t>(kind), v[0], v[1], v[2], v[3]};
}

/// Pairs whose boxes meet at some of so many moments.
std::set<FeaturePair> by_brute_force(const SurfaceFeatures& features, std::span<const VertexPath> path, int moments) {
    std::set<FeaturePair> pairs;
    for (int m = 0; m < moments; ++m) {
        const double part = moments == 1 ? 0.0 : static_cast<double>(m) / (moments - 1);
        for (const std::uint32_t v : features.vertices()) {
            const Box box = around(path, {&v, 1}, part);
            for (const Triangle& t : features.triangles()) {
                if (std::ranges::find(t, v) == t.end() && meet(box, around(path, t, part))) {
                    pairs.insert(sorted(PairKind::VertexTriangle, {v, t[0], t[1], t[2]}));
                }
            }
        }
        for (std::size_t a = 0; a < features.edges().size(); ++a) {
            const auto& e = features.edges()[a];
            const Box box = around(path, e, part);
            for (std::size_t b = a + 1; b < features.edges().size(); ++b) {
                const auto& f = features.edges()[b];
                const bool share = e[0] == f[0] || e[0] == f[1] || e[1] == f[0] || e[1] == f[1];
                if (!share && meet(box, around(path, f, part))) {
                    pairs.insert(sorted(PairKind::EdgeEdge, {e[0], e[1], f[0], f[1]}));
                }
            }
        }
    }
    return pairs;
}

/// Each pair must be found once.
std::set<FeaturePair> by_search(SurfaceFeatures& features, std::span<const VertexPath> path) {
    std::set<FeaturePair> found;
    std::size_t count = 0;
    features.search(path, [&](PairKind kind, const auto& vertex) {
        for (std::size_t k = 0; k < vertex[0].size(); ++k, ++count) {
            found.insert(sorted(kind, {vertex[0][k], vertex[1][k], vertex[2][k], vertex[3][k]}));
        }
    });
    EXPECT_EQ(count, found.size()) << "a pair was found twice";
    return found;
}

/// Crumpled: vertices shifted at random by a few cells, in boxes of a fraction of one. They go ways of up to `way`
/// cells, and all of them `common`.
std::vector<VertexPath> crumpled(const TriangleMesh& mesh, double cell, double way, const Vec3& common) {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    const auto any = [&] {
        const double a = unit(random), b = unit(random), c = unit(random);
        return Vec3(a, b, c);
    };
    std::vector<VertexPath> path;
    for (std::size_t k = 0; k < 2; ++k) {
        for (const Vec3& x : mesh.vertices) {
            const Vec3 start = x + cell * any();
            path.push_back({.start = start, .way = common + way * cell * any(), .margin = Vec3(0.1 * cell)});
        }
    }
    return path;
}

TEST_P(TwoCloths, SearchFindsAllPairsAtRestOnce) {
    const std::vector<VertexPath> path = crumpled(mesh, 1.0 / (GetParam() - 1), 0.0, Vec3(0.0));
    for (const std::size_t lanes : ParticleCollisions::usable_lanes()) {
        SurfaceFeatures features(surfaces, collider_kernels(lanes));
        const std::set<FeaturePair> found = by_search(features, path);
        EXPECT_EQ(found, by_brute_force(features, path, 1)) << lanes << " lanes";
        EXPECT_FALSE(found.empty());
    }
}

TEST_P(TwoCloths, SearchFindsWhatMeetsOnItsWay) {
    // Within the second cloth vertices go as far as a cell, and relative to the first three cells.
    const double cell = 1.0 / (GetParam() - 1);
    std::vector<VertexPath> path = crumpled(mesh, cell, 0.5, Vec3(20.0, -30.0, 10.0));
    for (std::size_t v = mesh.vertices.size(); v < path.size(); ++v) {
        path[v].way += cell * Vec3(1.0, 3.0, -2.0);
    }
    for (const std::size_t lanes : ParticleCollisions::usable_lanes()) {
        SurfaceFeatures features(surfaces, collider_kernels(lanes));
        const std::set<FeaturePair> found = by_search(features, path);
        const std::set<FeaturePair> expected = by_brute_force(features, path, 6);
        EXPECT_TRUE(std::ranges::includes(found, expected)) << lanes << " lanes";
        EXPECT_FALSE(expected.empty());
    }
}

TEST_P(TwoCloths, SearchFindsNoMorePairsOfWhatMovesAlike) {
    const double cell = 1.0 / (GetParam() - 1);
    const std::vector<VertexPath> at_rest = crumpled(mesh, cell, 0.0, Vec3(0.0));
    const std::vector<VertexPath> fast = crumpled(mesh, cell, 0.0, Vec3(1.0, -14.0, 2.0));
    SurfaceFeatures features(surfaces, collider_kernels(1));
    EXPECT_EQ(by_search(features, fast), by_search(features, at_rest));
}

INSTANTIATE_TEST_SUITE_P(Sizes, TwoCloths, ::testing::Values(2u, 5u, 17u));

TEST(SurfaceFeatures, CountSecondFacesOnce) {
    const TriangleMesh mesh = make_cloth_mesh({.vertices_per_side = 9});
    const ParticleSurface surface{.first_particle = 7, .triangles = mesh.triangles, .rest = mesh.vertices};
    const SurfaceFeatures features({&surface, 1}, collider_kernels(1));
    EXPECT_EQ(features.triangles().size(), 8u * 8 * 2);
    EXPECT_EQ(features.edges().size(), 2u * 9 * 8 + 8 * 8);
    EXPECT_EQ(features.vertices().size(), 81u);
    EXPECT_EQ(*std::ranges::min_element(features.vertices()), 7u);
}

TEST(SurfaceFeatures, RefuseAVertexThatDoesNotExist) {
    const std::vector<Triangle> triangles{{0, 1, 3}};
    const std::vector<Vec3> rest(3, Vec3(0.0));
    const ParticleSurface surface{.first_particle = 0, .triangles = triangles, .rest = rest};
    EXPECT_THROW(SurfaceFeatures({&surface, 1}, collider_kernels(1)), std::invalid_argument);
}

}  // namespace
}  // namespace haptic::sim
