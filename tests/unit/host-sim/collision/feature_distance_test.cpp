#include "collision/feature_distance.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <limits>
#include <random>

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

}  // namespace
}  // namespace haptic::sim
