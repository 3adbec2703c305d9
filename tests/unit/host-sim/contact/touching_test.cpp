#include "contact/touching.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "haptic/sim/contact/swept_tree.hpp"

namespace {

using haptic::Vec3;
using haptic::sim::Feature;
using haptic::sim::MovingSurface;
using haptic::sim::SurfaceMotion;
using haptic::sim::SweptTree;
using haptic::sim::Touching;
using haptic::sim::TouchingSet;
using haptic::sim::Triangle;

/// A floor for x < 0 and, from the crease x = 0 on, a slope that rises (or falls) by `angle`; two large triangles each.
struct Fold {
    explicit Fold(double angle)
        : vertices{{-9, 0, -9},
                   {-9, 0, 9},
                   {0, 0, -9},
                   {0, 0, 9},
                   {9, 9 * std::tan(angle), -9},
                   {9, 9 * std::tan(angle), 9}},
          triangles{{0, 1, 3}, {0, 3, 2}, {2, 3, 5}, {2, 5, 4}},
          tree(vertices, triangles) {
        tree.refit({vertices, vertices, triangles});
    }
    [[nodiscard]] std::vector<Touching> touched(const Vec3& center) const {
        const std::array<MovingSurface, 1> surfaces{MovingSurface{{vertices, vertices, triangles}, &tree}};
        TouchingSet set;
        set.gather(surfaces, 1.0, center, 1.002, nullptr);
        return {set.points().begin(), set.points().end()};
    }
    std::vector<Vec3> vertices;
    std::vector<Triangle> triangles;
    SweptTree tree;
};

constexpr double kDegree = 3.14159265358979323846 / 180.0;

TEST(Touching, TakesTheSlopeAcrossAValleyAsAFaceAndNotItsBorder) {
    const auto touched = Fold(2.0 * kDegree).touched({-0.04, 1.0, 0.3});
    ASSERT_EQ(touched.size(), 2u);
    EXPECT_NEAR(glm::length(touched[0].normal - Vec3(0, 1, 0)), 0.0, 1e-12);
    EXPECT_EQ(touched[1].at.feature, Feature::Face);
    const Vec3 slope(-std::sin(2.0 * kDegree), std::cos(2.0 * kDegree), 0);
    EXPECT_NEAR(glm::length(touched[1].normal - slope), 0.0, 1e-12) << "not the direction from the crease";
}

TEST(Touching, LeavesOutWhatARidgeOrAFlatSheetAlreadyImplies) {
    EXPECT_EQ(Fold(-2.0 * kDegree).touched({-0.04, 1.0, 0.3}).size(), 1u);
    EXPECT_EQ(Fold(0.0).touched({-0.04, 1.0, 0.3}).size(), 1u);
    EXPECT_EQ(Fold(0.0).touched({0.0, 1.0, 0.3}).size(), 1u) << "right above the crease";
}

TEST(Touching, KeepsBothSidesOfASteepValley) {
    const double half = 20.0 * kDegree;
    const auto touched = Fold(2.0 * half).touched({-std::tan(half), 1.0, 0.3});
    ASSERT_EQ(touched.size(), 2u);
    EXPECT_NEAR(touched[0].distance, 1.0, 1e-12);
    EXPECT_NEAR(touched[1].distance, 1.0, 1e-12);
}

}  // namespace
