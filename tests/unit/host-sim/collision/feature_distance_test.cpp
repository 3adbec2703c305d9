#include "collision/feature_distance.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <limits>
#include <random>
#include <vector>

#include "dynamics/rows.hpp"
#include "simd/kernels.hpp"

namespace haptic::sim {
namespace {

constexpr PairKind kPairKinds[] = {PairKind::VertexTriangle, PairKind::EdgeEdge};

FeatureVertices random_features(std::mt19937& random) {
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    FeatureVertices x;
    for (Vec3& v : x) {
        const double a = unit(random), b = unit(random), c = unit(random);
        v = Vec3(a, b, c);
    }
    return x;
}

/// m, between the points of a fine grid on both features.
double sampled_distance(PairKind kind, const FeatureVertices& x, int steps) {
    double least = std::numeric_limits<double>::max();
    for (int i = 0; i <= steps; ++i) {
        for (int j = 0; j <= steps; ++j) {
            const double s = i / static_cast<double>(steps);
            const double t = j / static_cast<double>(steps);
            const Vec3 first = kind == PairKind::EdgeEdge ? glm::mix(x[0], x[1], s) : x[0];
            const Vec3 second = kind == PairKind::EdgeEdge ? glm::mix(x[2], x[3], t)
                                                           : x[1] + (1.0 - t) * s * (x[2] - x[1]) + t * (x[3] - x[1]);
            least = std::min(least, glm::length(first - second));
        }
    }
    return least;
}

TEST(FeatureDistance, IsThatOfTheNearestPoints) {
    std::mt19937 random(1);
    for (const PairKind kind : kPairKinds) {
        for (int n = 0; n < 500; ++n) {
            const FeatureVertices x = random_features(random);
            const NearestPoints nearest = nearest_points(kind, x);
            Vec3 apart(0.0);
            for (std::size_t k = 0; k < 4; ++k) {
                apart += nearest.weight[k] * x[k];
            }
            EXPECT_LT(glm::length(apart - nearest.apart), 1e-12);
            EXPECT_NEAR(nearest.distance, glm::length(nearest.apart), 1e-15);
            const double sampled = sampled_distance(kind, x, 100);
            EXPECT_LE(nearest.distance, sampled + 1e-12) << "pair " << n;
            EXPECT_GE(nearest.distance, sampled - 0.04) << "pair " << n;
        }
    }
}

TEST(FeatureDistance, HasWeightsOfPointsInBothFeatures) {
    std::mt19937 random(2);
    for (const PairKind kind : kPairKinds) {
        const auto first = static_cast<std::size_t>(kind);
        for (int n = 0; n < 500; ++n) {
            const NearestPoints nearest = nearest_points(kind, random_features(random));
            double sums[2] = {};
            for (std::size_t k = 0; k < 4; ++k) {
                const double weight = k < first ? nearest.weight[k] : -nearest.weight[k];
                EXPECT_GE(weight, 0.0);
                sums[k < first ? 0 : 1] += weight;
            }
            EXPECT_NEAR(sums[0], 1.0, 1e-12);
            EXPECT_NEAR(sums[1], 1.0, 1e-12);
        }
    }
}

TEST(FeatureDistance, IsFiniteForEdgesThatAreParallelOrPoints) {
    const Vec3 o(0.0);
    const Vec3 x(1.0, 0.0, 0.0);
    const Vec3 up(0.0, 0.5, 0.0);
    EXPECT_DOUBLE_EQ(nearest_points(PairKind::EdgeEdge, {o, x, up, x + up}).distance, 0.5);
    EXPECT_DOUBLE_EQ(nearest_points(PairKind::EdgeEdge, {o, x, 2.0 * x + up, 3.0 * x + up}).distance, std::sqrt(1.25));
    EXPECT_DOUBLE_EQ(nearest_points(PairKind::EdgeEdge, {o, o, up, up}).distance, 0.5);
    EXPECT_DOUBLE_EQ(nearest_points(PairKind::EdgeEdge, {o, x, 0.5 * x + up, 0.5 * x + up}).distance, 0.5);
    EXPECT_DOUBLE_EQ(nearest_points(PairKind::VertexTriangle, {up, o, o, o}).distance, 0.5);
    EXPECT_DOUBLE_EQ(nearest_points(PairKind::VertexTriangle, {o, o, x, up}).distance, 0.0);
}

/// Every other pair is degenerate: vertices that coincide or lie on a line.
std::vector<FeatureVertices> features_of_all_shapes(std::size_t count) {
    std::mt19937 random(3);
    std::vector<FeatureVertices> features;
    for (std::size_t n = 0; n < count; ++n) {
        FeatureVertices x = random_features(random);
        if (n % 2 == 1) {
            const std::size_t a = random() % 4, b = random() % 4, c = random() % 4;
            x[a] = n % 4 == 1 ? x[b] : 0.25 * x[b] + 0.75 * x[c];
        }
        features.push_back(x);
    }
    return features;
}

TEST(FeatureKernels, FindTheNearestPointsOfEachPairWithAnyNumberOfLanes) {
    const std::vector<FeatureVertices> features = features_of_all_shapes(1001);  // whole vectors and some left
    const std::size_t count = features.size();
    std::vector<Row> position;
    std::array<std::vector<std::uint32_t>, 4> vertex;
    for (const FeatureVertices& x : features) {
        for (std::size_t k = 0; k < 4; ++k) {
            vertex[k].push_back(static_cast<std::uint32_t>(position.size()));
            position.push_back(row_of(x[k]));
        }
    }
    for (const PairKind kind : kPairKinds) {
        std::vector<double> expected_bits;
        for (const std::size_t lanes : lanes_of(&Kernels::features)) {
            SCOPED_TRACE(lanes);
            std::array<std::vector<double>, 9> out;  // weights, normal, gap, distance
            for (std::vector<double>& of : out) {
                of.resize(count, std::numeric_limits<double>::quiet_NaN());
            }
            find_kernels(&Kernels::features, lanes)
                ->find_nearest(kind,
                               {{vertex[0].data(), vertex[1].data(), vertex[2].data(), vertex[3].data()},
                                {out[4].data(), out[5].data(), out[6].data()},
                                out[7].data()},
                               count, position.data(),
                               {{out[0].data(), out[1].data(), out[2].data(), out[3].data()}, out[8].data()});
            for (std::size_t n = 0; n < count; ++n) {
                const NearestPoints expected = nearest_points(kind, features[n]);
                ASSERT_NEAR(out[8][n], expected.distance, 1e-7) << "pair " << n;
                // Its weights are those of points in both features, so far apart.
                Vec3 apart(0.0);
                double sums[2] = {};
                for (std::size_t k = 0; k < 4; ++k) {
                    const bool first = k < static_cast<std::size_t>(kind);
                    const double weight = first ? out[k][n] : -out[k][n];
                    ASSERT_GE(weight, 0.0) << "pair " << n;
                    sums[first ? 0 : 1] += weight;
                    apart += out[k][n] * features[n][k];
                }
                ASSERT_NEAR(sums[0], 1.0, 1e-12) << "pair " << n;
                ASSERT_NEAR(sums[1], 1.0, 1e-12) << "pair " << n;
                ASSERT_NEAR(glm::length(apart), out[8][n], 1e-12) << "pair " << n;
                if (out[8][n] > 1e-6) {
                    const Vec3 normal(out[4][n], out[5][n], out[6][n]);
                    ASSERT_LT(glm::length(normal - apart / out[8][n]), 1e-6) << "pair " << n;
                    ASSERT_LE(out[7][n], out[8][n] + 1e-12) << "pair " << n;
                }
            }
            std::vector<double> bits;
            for (const std::vector<double>& of : out) {
                bits.insert(bits.end(), of.begin(), of.end());
            }
            if (expected_bits.empty()) {
                expected_bits = bits;
            }
            EXPECT_EQ(bits, expected_bits);
        }
    }
}

}  // namespace
}  // namespace haptic::sim
