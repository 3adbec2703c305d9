#include "collision/feature_pairs.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <glm/common.hpp>
#include <random>
#include <vector>

#include "dynamics/rows.hpp"

namespace haptic::sim {
namespace {

constexpr PairKind kBothKinds[] = {PairKind::VertexTriangle, PairKind::EdgeEdge};
constexpr double kLeast = 0.01;  // m

FeatureVertices at_part(const FeatureVertices& from, const FeatureVertices& to, double part) {
    FeatureVertices x;
    for (std::size_t k = 0; k < 4; ++k) {
        x[k] = glm::mix(from[k], to[k], part);
    }
    return x;
}

double safe_part_of(PairKind kind, const FeatureVertices& from, const FeatureVertices& to) {
    FeaturePairs pairs(kind);
    const std::array<std::uint32_t, 4> number{0, 1, 2, 3};
    pairs.assign(kind, {std::span(number).subspan(0, 1), std::span(number).subspan(1, 1),
                        std::span(number).subspan(2, 1), std::span(number).subspan(3, 1)});
    std::vector<Row> start;
    std::vector<Row> end;
    for (std::size_t k = 0; k < 4; ++k) {
        start.push_back(row_of(from[k]));
        end.push_back(row_of(to[k]));
    }
    return pairs.safe_part(0, nearest_points(kind, from), start.data(), end.data(), kLeast);
}

FeatureVertices random_vertices(std::mt19937& random, double size) {
    std::uniform_real_distribution<double> within(-size, size);
    FeatureVertices x;
    for (Vec3& v : x) {
        for (int axis = 0; axis < 3; ++axis) {
            v[axis] = within(random);
        }
    }
    return x;
}

TEST(FeaturePairs, StayApartOnThePartOfTheWayThatIsSafe) {
    std::mt19937 random(1);
    for (const PairKind kind : kBothKinds) {
        int whole = 0;
        int halted = 0;
        for (int n = 0; n < 6000; ++n) {
            const FeatureVertices from = random_vertices(random, 1.0);
            const FeatureVertices way = random_vertices(random, n % 3 == 0 ? 3.0 : n % 3 == 1 ? 1.0 : 0.05);
            FeatureVertices to = from;
            for (std::size_t k = 0; k < 4; ++k) {
                to[k] += way[k];
            }
            const double at_start = nearest_points(kind, from).distance;
            const double part = safe_part_of(kind, from, to);
            ASSERT_GE(part, 0.0);
            ASSERT_LE(part, 1.0);
            // What is halted keeps half of it, less rounding.
            const double least = std::min(kLeast, at_start);
            for (int k = 0; k <= 200; ++k) {
                const double distance = nearest_points(kind, at_part(from, to, part * k / 200.0)).distance;
                ASSERT_GT(distance, part < 1.0 ? 0.45 * least : 0.0) << "pair " << n << " at " << k;
            }
            if (part == 1.0) {
                ASSERT_GE(nearest_points(kind, to).distance, (1.0 - 1e-9) * least) << "pair " << n;
            }
            ++(part == 1.0 ? whole : halted);
        }
        EXPECT_GT(whole, 1000);
        EXPECT_GT(halted, 100);
    }
}

TEST(FeaturePairs, GoNearlyAsFarAsTheyMayHoweverFastTheySlide) {
    // They meet in the middle of the way. Meanwhile the second feature slides past the first by a thousand times that.
    const double height = 0.1;
    for (const double slide : {0.0, 1.0, 100.0}) {
        const Vec3 down(0.0, -2.0 * height, 0.0);
        const Vec3 along(slide, 0.0, 0.0);
        const double far = slide + 1.0;
        const Vec3 up(0.0, height, 0.0);
        const FeatureVertices triangle{up, Vec3(-far, 0.0, -1.0), Vec3(far, 0.0, -1.0), Vec3(0.0, 0.0, 3.0 * far)};
        const FeatureVertices onto{up + down, triangle[1] + along, triangle[2] + along, triangle[3] + along};
        const FeatureVertices edges{Vec3(0.1, height, -1.0), Vec3(0.1, height, 1.0), Vec3(-far, 0.0, 0.0),
                                    Vec3(far, 0.0, 0.0)};
        const FeatureVertices through{edges[0] + down, edges[1] + down, edges[2] + along, edges[3] + along};
        for (const double part : {safe_part_of(PairKind::VertexTriangle, triangle, onto),
                                  safe_part_of(PairKind::EdgeEdge, edges, through)}) {
            EXPECT_LT(part, 0.5) << slide;
            EXPECT_GT(part, 0.5 * (1.0 - kLeast / height) * 0.9) << slide;
        }
    }
}

TEST(FeaturePairs, WhatIsNearerThanTheLeastMayComeNoNearer) {
    const auto above = [](double height) {
        return FeatureVertices{Vec3(0.0, height, 0.0), Vec3(-1.0, 0.0, -1.0), Vec3(1.0, 0.0, -1.0),
                               Vec3(0.0, 0.0, 1.0)};
    };
    const PairKind kind = PairKind::VertexTriangle;
    EXPECT_EQ(safe_part_of(kind, above(0.5 * kLeast), above(0.5 * kLeast)), 1.0);
    EXPECT_EQ(safe_part_of(kind, above(0.5 * kLeast), above(0.6 * kLeast)), 1.0);
    EXPECT_LT(safe_part_of(kind, above(0.5 * kLeast), above(0.4 * kLeast)), 1.0);
    EXPECT_LT(safe_part_of(kind, above(2.0 * kLeast), above(0.9 * kLeast)), 1.0);
    EXPECT_EQ(safe_part_of(kind, above(2.0 * kLeast), above(1.1 * kLeast)), 1.0);
    // Nothing tells the sides apart of what touches.
    EXPECT_EQ(safe_part_of(kind, above(0.0), above(-1.0)), 1.0);
}

}  // namespace
}  // namespace haptic::sim
