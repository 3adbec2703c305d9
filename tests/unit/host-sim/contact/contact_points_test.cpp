#include "contact/contact_points.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "contact/oracle.hpp"
#include "contact/scenes.hpp"
#include "contact/swept_sphere.hpp"
#include "contact/swept_tree.hpp"

namespace {

using haptic::Vec3;
using haptic::sim::closest_point_on_triangle;
using haptic::sim::ContactPoint;
using haptic::sim::ContactPointSet;
using haptic::sim::Feature;
using haptic::sim::free_fraction;
using haptic::sim::MovingSurface;
using haptic::sim::SphereHit;
using haptic::sim::SurfaceMotion;
using haptic::sim::sweep_sphere;
using haptic::sim::SweptTree;
using haptic::sim::Triangle;
using haptic::sim::TriangleCorners;
using haptic::sim::oracle::Random;
using haptic::sim::scenes::Body;
using haptic::sim::scenes::sheet;
using haptic::sim::scenes::World;

/// A floor for x < 0 and, from the crease x = 0, a slope that rises (or falls) by `angle`; two large triangles each.
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
    [[nodiscard]] std::vector<ContactPoint> touched(const Vec3& center) const {
        const std::array<MovingSurface, 1> surfaces{MovingSurface{{vertices, vertices, triangles}, &tree}};
        ContactPointSet set;
        set.collect(surfaces, 1.0, center, 1.002);
        return {set.points().begin(), set.points().end()};
    }
    std::vector<Vec3> vertices;
    std::vector<Triangle> triangles;
    SweptTree tree;
};

constexpr double kDegree = 3.14159265358979323846 / 180.0;

TEST(ContactPointSet, TakesTheSlopeAcrossAValleyAsAFaceAndNotItsBorder) {
    const auto touched = Fold(2.0 * kDegree).touched({-0.04, 1.0, 0.3});
    ASSERT_EQ(touched.size(), 2u);
    EXPECT_NEAR(glm::length(touched[0].normal - Vec3(0, 1, 0)), 0.0, 1e-12);
    EXPECT_EQ(touched[1].at.feature, Feature::Face);
    const Vec3 slope(-std::sin(2.0 * kDegree), std::cos(2.0 * kDegree), 0);
    EXPECT_NEAR(glm::length(touched[1].normal - slope), 0.0, 1e-12) << "not the direction from the crease";
}

TEST(ContactPointSet, LeavesOutWhatARidgeOrAFlatSheetAlreadyImplies) {
    EXPECT_EQ(Fold(-2.0 * kDegree).touched({-0.04, 1.0, 0.3}).size(), 1u);
    EXPECT_EQ(Fold(0.0).touched({-0.04, 1.0, 0.3}).size(), 1u);
    EXPECT_EQ(Fold(0.0).touched({0.0, 1.0, 0.3}).size(), 1u) << "right above the crease";
}

TEST(ContactPointSet, KeepsBothSidesOfASteepValley) {
    const double half = 20.0 * kDegree;
    const auto touched = Fold(2.0 * half).touched({-std::tan(half), 1.0, 0.3});
    ASSERT_EQ(touched.size(), 2u);
    EXPECT_NEAR(touched[0].distance, 1.0, 1e-12);
    EXPECT_NEAR(touched[1].distance, 1.0, 1e-12);
}

TEST(ContactPointSet, LetsASphereMoveAsFarAsTheFirstOfAllTrianglesWhateverTheLengthOfTheMove) {
    // Long moves are swept in parts; the oracle is every triangle by itself.
    Random random(4);
    const double radius = 0.05;
    int stopped = 0;
    for (int k = 0; k < 400; ++k) {
        World world;
        for (int n = 0; n < 3; ++n) {
            Body& body = world.add(sheet(0.6, 6, false));
            const Vec3 shift = random.in_cube(0.4);
            for (std::size_t v = 0; v < body.end.size(); ++v) {
                body.start[v] = body.end[v] += shift + random.in_cube(0.05);
            }
        }
        world.refit();
        const Vec3 from = random.in_cube(0.5);
        const Vec3 displacement = random.direction() * (radius * random.uniform(0.0, 12.0));
        double first = 1.0;
        for (const auto& body : world.bodies) {
            for (const Triangle& t : body->mesh.triangles) {
                const TriangleCorners corners{body->end[t[0]], body->end[t[1]], body->end[t[2]]};
                const double distance = std::sqrt(closest_point_on_triangle(from, corners).squared_distance);
                const SphereHit hit =
                    sweep_sphere(from, displacement, std::min(radius, 0.999 * distance), distance, corners);
                first = hit.hits ? std::min(first, hit.fraction) : first;
            }
        }
        EXPECT_EQ(free_fraction(world.surfaces, from, displacement, radius, 0.999), first) << k;
        stopped += first < 1.0 ? 1 : 0;
    }
    EXPECT_GT(stopped, 50);
}

}  // namespace
