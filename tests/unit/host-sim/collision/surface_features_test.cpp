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

bool meet(const SurfaceFeatures::Box& a, const SurfaceFeatures::Box& b) {
    return glm::all(glm::lessThanEqual(a.low, b.high)) && glm::all(glm::lessThanEqual(b.low, a.high));
}

SurfaceFeatures::Box around(std::span<const SurfaceFeatures::Box> box, std::span<const std::uint32_t> vertices) {
    SurfaceFeatures::Box all = box[vertices[0]];
    for (const std::uint32_t v : vertices) {
        all = {glm::min(all.low, box[v].low), glm::max(all.high, box[v].high)};
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

std::set<FeaturePair> by_brute_force(const SurfaceFeatures& features, std::span<const SurfaceFeatures::Box> box) {
    std::set<FeaturePair> pairs;
    for (const std::uint32_t v : features.vertices()) {
        for (const Triangle& t : features.triangles()) {
            if (std::ranges::find(t, v) == t.end() && meet(box[v], around(box, t))) {
                pairs.insert(sorted(PairKind::VertexTriangle, {v, t[0], t[1], t[2]}));
            }
        }
    }
    for (std::size_t a = 0; a < features.edges().size(); ++a) {
        for (std::size_t b = a + 1; b < features.edges().size(); ++b) {
            const auto& e = features.edges()[a];
            const auto& f = features.edges()[b];
            const bool share = e[0] == f[0] || e[0] == f[1] || e[1] == f[0] || e[1] == f[1];
            if (!share && meet(around(box, e), around(box, f))) {
                pairs.insert(sorted(PairKind::EdgeEdge, {e[0], e[1], f[0], f[1]}));
            }
        }
    }
    return pairs;
}

TEST_P(TwoCloths, SearchFindsAllPairsOnce) {
    for (const std::size_t lanes : ParticleCollisions::usable_lanes()) {
        SurfaceFeatures features(surfaces, collider_kernels(lanes));
        std::mt19937 random(3);
        std::uniform_real_distribution<double> unit(-1.0, 1.0);
        // Crumpled: vertices shifted at random by a few cells, in boxes of a fraction of one.
        const double cell = 1.0 / (GetParam() - 1);
        std::vector<SurfaceFeatures::Box> box;
        for (std::size_t k = 0; k < 2; ++k) {
            for (const Vec3& x : mesh.vertices) {
                const double a = unit(random), b = unit(random), c = unit(random);
                const Vec3 at = x + cell * Vec3(a, b, c);
                box.push_back({at - Vec3(0.1 * cell), at + Vec3(0.1 * cell)});
            }
        }
        std::set<FeaturePair> found;
        std::size_t count = 0;
        features.search(box, [&](PairKind kind, const auto& vertex) {
            for (std::size_t k = 0; k < vertex[0].size(); ++k, ++count) {
                found.insert(sorted(kind, {vertex[0][k], vertex[1][k], vertex[2][k], vertex[3][k]}));
            }
        });
        EXPECT_EQ(count, found.size()) << "a pair was found twice";
        EXPECT_EQ(found, by_brute_force(features, box)) << lanes << " lanes";
        EXPECT_FALSE(found.empty());
    }
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
