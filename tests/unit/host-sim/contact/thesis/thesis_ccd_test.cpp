#include "contact/thesis/thesis_ccd.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

#include "contact/oracle.hpp"
#include "contact/scenes.hpp"

namespace {

using haptic::Mat3;
using haptic::Vec3;
using haptic::sim::CcdMethod;
using haptic::sim::ContactSettings;
using haptic::sim::Feature;
using haptic::sim::MovingTriangle;
using haptic::sim::SecurePosition;
using haptic::sim::thesis_triangle_ccd;
using haptic::sim::ThesisContact;
using haptic::sim::oracle::Motion;
using haptic::sim::oracle::Query;
using haptic::sim::oracle::Random;
using haptic::sim::scenes::Body;
using haptic::sim::scenes::kRadius;
using haptic::sim::scenes::kUpright;
using haptic::sim::scenes::placed;
using haptic::sim::scenes::rotation;
using haptic::sim::scenes::sheet;
using haptic::sim::scenes::World;

constexpr int kSteps = 400;  // of a search for changes of sign

MovingTriangle shifted(const MovingTriangle& t, const Vec3& by) {
    return {{t.start.a + by, t.start.b + by, t.start.c + by}, {t.end.a + by, t.end.b + by, t.end.c + by}};
}

constexpr MovingTriangle kFalling{{{-4, 5, -4}, {4, 5, -4}, {0, 5, 6}}, {{-4, -5, -4}, {4, -5, -4}, {0, -5, 6}}};

ContactSettings thesis() {
    ContactSettings settings;
    settings.method = CcdMethod::Thesis;
    return settings;
}

TEST(ThesisCcd, TimesAFaceByItsPlaneAndTheCentre) {
    const ThesisContact c = thesis_triangle_ccd(Vec3(0.0), 1.0, kFalling);
    EXPECT_EQ(c.feature, Feature::Face);
    EXPECT_NEAR(c.time, 0.5, 1e-15);
    EXPECT_NEAR(glm::length(c.normal - Vec3(0, -1, 0)), 0.0, 1e-15) << "the side where the centre was";
}

TEST(ThesisCcd, SeesBothFacesOfASheetAlike) {
    MovingTriangle other = kFalling;
    std::swap(other.start.b, other.start.c);
    std::swap(other.end.b, other.end.c);
    const ThesisContact c = thesis_triangle_ccd(Vec3(0.0), 1.0, other);
    EXPECT_EQ(c.feature, Feature::Face);
    EXPECT_NEAR(glm::length(c.normal - Vec3(0, -1, 0)), 0.0, 1e-15);
}

TEST(ThesisCcd, CountsATriangleBesideTheCentreAsEdgeOrVertexWithinTheRadiusOnly) {
    const ThesisContact edge = thesis_triangle_ccd(Vec3(0.0), 1.0, shifted(kFalling, {0, 0, 4.75}));
    EXPECT_EQ(edge.feature, Feature::Edge);
    EXPECT_NEAR(edge.time, 0.5, 1e-15);
    EXPECT_NEAR(std::sqrt(edge.at.squared_distance), 0.75, 1e-15);
    EXPECT_NEAR(glm::length(edge.normal - Vec3(0, 0, -1)), 0.0, 1e-15) << "away from the triangle";
    EXPECT_EQ(thesis_triangle_ccd(Vec3(0.0), 1.0, shifted(kFalling, {0, 0, -6.5})).feature, Feature::Vertex);
    EXPECT_EQ(thesis_triangle_ccd(Vec3(0.0), 1.0, shifted(kFalling, {0, 0, 5.01})).feature, Feature::None);
    EXPECT_EQ(thesis_triangle_ccd(Vec3(0.0), 1.0, shifted(kFalling, {0, 0, 4})).feature, Feature::Face)
        << "right on the border: no direction for an edge contact";
}

TEST(ThesisCcd, TakesTheSmallestRootWithinTheStepOfThree) {
    Random random(4);
    int three = 0;
    int taken = 0;
    for (int k = 0; k < 20000; ++k) {
        Query q;
        for (std::size_t i = 0; i < 3; ++i) {
            q.start[i] = random.in_cube(1.0);
            q.end[i] = random.in_cube(1.0);
        }
        // Sign changes of the signed volume of origin and corners over fine steps, which need no formula of a cubic.
        std::vector<double> roots;
        const auto volume = [&](double t) {
            const auto x = haptic::sim::oracle::at(q, t);
            return glm::dot(x[0], glm::cross(x[1], x[2]));
        };
        for (int s = 0; s < kSteps; ++s) {
            double low = static_cast<double>(s) / kSteps;
            double high = static_cast<double>(s + 1) / kSteps;
            if (volume(low) * volume(high) < 0.0) {
                for (int n = 0; n < 60; ++n) {
                    const double middle = 0.5 * (low + high);
                    (volume(low) * volume(middle) <= 0.0 ? high : low) = middle;
                }
                roots.push_back(high);
            }
        }
        three += roots.size() == 3 ? 1 : 0;
        const ThesisContact c = thesis_triangle_ccd(Vec3(0.0), 100.0, moving(q));
        if (roots.empty()) {
            continue;
        }
        ++taken;
        ASSERT_NE(c.feature, Feature::None) << "query " << k;
        // The sampling does not see two roots within one of its steps: then the solver's root is the earlier one.
        ASSERT_LE(c.time, roots[0] + 1e-9) << "query " << k;
        if (c.time < roots[0] - 1e-9) {
            ASSERT_NEAR(volume(c.time), 0.0, 1e-12) << "query " << k;
        }
    }
    EXPECT_GT(three, 100);
    EXPECT_GT(taken, 5000);
}

TEST(ThesisCcd, FindsTheSameContactsAtEveryScale) {
    for (const double scale : {1e-6, 1e-3, 1e3, 1e6}) {
        Random reference(5);
        Random scaled(5);
        int found = 0;
        for (int k = 0; k < 2000; ++k) {
            const auto motion = static_cast<Motion>(k % 4);
            const Query one = haptic::sim::oracle::random_query(reference, motion, 1.0);
            const Query other = haptic::sim::oracle::random_query(scaled, motion, scale);
            const ThesisContact a = thesis_triangle_ccd(one.center, one.radius, moving(one));
            const ThesisContact b = thesis_triangle_ccd(other.center, other.radius, moving(other));
            ASSERT_EQ(a.feature, b.feature) << "query " << k << " at scale " << scale;
            ASSERT_NEAR(a.time, b.time, 1e-9) << "query " << k << " at scale " << scale;
            found += a.feature != Feature::None ? 1 : 0;
        }
        EXPECT_GT(found, 400);
    }
}

TEST(ThesisCcd, MissesWhatClipsTheSphereWhileItsPlaneDoesNotPassTheCentre) {
    // An edge-on sheet 0.3 above the centre: the complete method touches, Algorithm 1 has no root.
    const MovingTriangle edge_on{{{5, 0.3, -3}, {5, 0.3, 3}, {9, 0.3, 0}}, {{-9, 0.3, -3}, {-9, 0.3, 3}, {-5, 0.3, 0}}};
    EXPECT_TRUE(haptic::sim::sphere_triangle_ccd(Vec3(0.0), 1.0, edge_on).touches);
    EXPECT_EQ(thesis_triangle_ccd(Vec3(0.0), 1.0, edge_on).feature, Feature::None);
    // Through the centre, in its own plane: the cubic vanishes and defines no time.
    EXPECT_EQ(thesis_triangle_ccd(Vec3(0.0), 1.0, shifted(edge_on, {0, -0.3, 0})).feature, Feature::None);
}

TEST(ThesisCcd, AnswersFiniteNumbersForDegenerateTriangles) {
    const MovingTriangle point{{{5, 0, 0}, {5, 0, 0}, {5, 0, 0}}, {{-5, 0, 0}, {-5, 0, 0}, {-5, 0, 0}}};
    EXPECT_EQ(thesis_triangle_ccd(Vec3(0.0), 1.0, point).feature, Feature::None);
    // Collapses to a point at the end: the face has no normal there.
    const MovingTriangle collapsing{{{-4, 5, -4}, {4, 5, -4}, {0, 5, 6}}, {{0, -5, 0}, {0, -5, 0}, {0, -5, 0}}};
    const ThesisContact c = thesis_triangle_ccd(Vec3(0.0), 1.0, collapsing);
    EXPECT_TRUE(std::isfinite(c.normal.x + c.normal.y + c.normal.z + c.time));
}

class ThesisCloth : public testing::Test {
  protected:
    ThesisCloth() : cloth(world.add(sheet(1.0, 32, true))) {}
    void fall(double height, double travel) {
        cloth.start = placed(cloth.mesh.vertices, kUpright, {0.004, height, 0.007});
        cloth.end = placed(cloth.mesh.vertices, kUpright, {0.004, height - travel, 0.007});
        world.refit();
    }
    World world;
    Body& cloth;
};

TEST_F(ThesisCloth, IsCaughtByItInEachOf140PhasesAsTheThesisReports) {
    int by_pop_out = 0;
    for (int phase = 0; phase < 140; ++phase) {
        const double height = kRadius + 0.001 * (phase + 0.5);
        fall(height, 0.14);
        const auto s = step(world, Vec3(0.0), Vec3(0.0), kRadius, thesis());
        by_pop_out += s.secure.touched ? 0 : 1;
        ASSERT_TRUE(s.crossings.empty()) << phase;
        ASSERT_NEAR(s.popped.position.y, height - 0.14 - kRadius, 1e-3 * kRadius) << phase;
        ASSERT_EQ(s.moved.contacts.count, 1u) << phase;
    }
    EXPECT_GT(by_pop_out, 0) << "where the cloth ends within the sphere, short of its centre";
    EXPECT_LT(by_pop_out, 60);
}

TEST_F(ThesisCloth, FindsTheSameAsWithoutATree) {
    Random random(6);
    for (int k = 0; k < 40; ++k) {
        const Mat3 attitude = rotation(random.direction(), random.uniform(0.0, 3.0));
        const Vec3 travel = random.direction() * 0.14;
        cloth.start = placed(cloth.mesh.vertices, attitude, random.in_cube(0.05) - travel * 0.5);
        cloth.end = placed(cloth.mesh.vertices, rotation(random.direction(), 0.3) * attitude, travel * 0.5);
        world.refit();
        const SecurePosition with_tree = secure_position(world.surfaces, Vec3(0.0), kRadius, thesis());
        double face = 2.0;
        double border = 2.0;
        for (const haptic::sim::Triangle& t : cloth.mesh.triangles) {
            const MovingTriangle m{{cloth.start[t[0]], cloth.start[t[1]], cloth.start[t[2]]},
                                   {cloth.end[t[0]], cloth.end[t[1]], cloth.end[t[2]]}};
            const ThesisContact c = thesis_triangle_ccd(Vec3(0.0), 0.999 * kRadius, m);
            if (c.feature == Feature::Face) {
                face = std::min(face, c.time);
            } else if (c.feature != Feature::None) {
                border = std::min(border, c.time);
            }
        }
        const double first = face <= 1.0 ? face : border;
        ASSERT_EQ(with_tree.touched, first <= 1.0) << k;
        if (with_tree.touched) {
            ASSERT_EQ(with_tree.first_time, first) << k << ": a face beats an edge, however late";
            ASSERT_EQ(with_tree.first.feature == Feature::Face, face <= 1.0) << k;
        }
    }
}

TEST_F(ThesisCloth, JumpsOverAFloorThatIsInTheWayAndOursDoesNot) {
    Body& floor = world.add(sheet(2.0, 4, false));
    floor.start = floor.end = placed(floor.mesh.vertices, kUpright, {0, -0.05, 0});
    fall(0.06, 0.14);
    const SecurePosition theirs = secure_position(world.surfaces, Vec3(0.0), kRadius, thesis());
    EXPECT_LT(theirs.position.y, -0.05) << "the jump to the secure position is not swept";
    const SecurePosition ours = secure_position(world.surfaces, Vec3(0.0), kRadius, {});
    EXPECT_GT(ours.position.y, -0.05);
}

}  // namespace
