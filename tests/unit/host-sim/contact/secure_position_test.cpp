#include "contact/secure_position.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "contact/oracle.hpp"
#include "contact/scenes.hpp"

namespace {

using haptic::Mat3;
using haptic::Vec3;
using haptic::sim::oracle::Random;
using haptic::sim::scenes::Body;
using haptic::sim::scenes::kRadius;
using haptic::sim::scenes::kTravel;
using haptic::sim::scenes::kUpright;
using haptic::sim::scenes::placed;
using haptic::sim::scenes::rotation;
using haptic::sim::scenes::sheet;
using haptic::sim::scenes::Step;
using haptic::sim::scenes::World;

/// Whether any triangle comes within the radius of the resting sphere at any time, by sampling each of them.
bool touched_by_anything(const Body& body, const Vec3& p, double radius) {
    for (const haptic::sim::Triangle& t : body.mesh.triangles) {
        const haptic::sim::oracle::Query q{p,
                                           radius,
                                           {body.start[t[0]], body.start[t[1]], body.start[t[2]]},
                                           {body.end[t[0]], body.end[t[1]], body.end[t[2]]}};
        // Its nearest corner is too far away for its size and motion.
        double size = 0.0;
        for (std::size_t k = 0; k < 3; ++k) {
            size = std::max({size, glm::length(q.end[k] - q.start[k]), glm::length(q.start[k] - q.start[0])});
        }
        if (haptic::sim::oracle::distance(p, q.start) > radius + size) {
            continue;
        }
        if (haptic::sim::oracle::sample(q, 64).touches) {
            return true;
        }
    }
    return false;
}

TEST(SecurePosition, StaysWhereNothingComes) {
    World world;
    Body& cloth = world.add(sheet(1.0, 8, true));
    cloth.start = placed(cloth.mesh.vertices, kUpright, {0, 0.3, 0});
    cloth.end = placed(cloth.mesh.vertices, kUpright, {0, 0.16, 0});
    world.refit();
    const Step s = step(world, Vec3(0.0), Vec3(0.0), kRadius);
    EXPECT_FALSE(s.secure.touched);
    EXPECT_EQ(s.secure.position, Vec3(0.0));
    EXPECT_EQ(s.moved.position, Vec3(0.0));
    EXPECT_EQ(s.moved.contacts.count, 0u);
}

TEST(SecurePosition, CatchesTheClothOfTheThesisInEachOf140Phases) {
    World world;
    Body& cloth = world.add(sheet(1.0, 32, true));
    for (int phase = 0; phase < 140; ++phase) {
        const double height = kRadius + 0.001 * (phase + 0.5);
        cloth.start = placed(cloth.mesh.vertices, kUpright, {0.004, height, 0.007});
        cloth.end = placed(cloth.mesh.vertices, kUpright, {0.004, height - kTravel, 0.007});
        world.refit();
        const Step s = step(world, Vec3(0.0), Vec3(0.0), kRadius);
        ASSERT_TRUE(s.secure.touched) << phase;
        ASSERT_NEAR(s.secure.first_time, 0.001 * (phase + 0.5) / kTravel, 3e-4) << phase;
        ASSERT_TRUE(s.crossings.empty()) << phase;
        ASSERT_FALSE(s.secure.overconstrained) << phase;
        ASSERT_GE(world.clearance(s.popped.position), 0.999 * kRadius) << phase;
        ASSERT_LE(s.moved.position.y, height - kTravel - 0.999 * kRadius) << "phase " << phase << ": below the cloth";
        ASSERT_EQ(s.moved.contacts.count, 1u) << phase;
        ASSERT_NEAR(s.moved.contacts.plane[0].normal.y, -1.0, 1e-9) << phase;
        ASSERT_NEAR(s.moved.contacts.plane[0].velocity, 14.0, 1e-6) << phase;
    }
}

enum class Attitude { Random, EdgeOn, Tumbling };

class Attitudes : public testing::TestWithParam<Attitude> {};

TEST_P(Attitudes, AFlyingClothIsNeverMissedAndNeverPassesTheCentre) {
    Random random(30 + static_cast<std::uint64_t>(GetParam()));
    World world;
    Body& cloth = world.add(sheet(0.25, 12, true));
    int touched = 0;
    int missed = 0;
    for (int k = 0; k < 500; ++k) {
        const Mat3 attitude = rotation(random.direction(), random.uniform(0.0, 3.0));
        Vec3 travel = random.direction() * kTravel;
        Mat3 rotated = attitude;
        if (GetParam() == Attitude::EdgeOn) {
            const Vec3 normal = attitude[1];
            travel = glm::normalize(travel - normal * glm::dot(travel, normal)) * kTravel;
        } else if (GetParam() == Attitude::Tumbling) {
            rotated = rotation(random.direction(), random.uniform(-0.8, 0.8)) * attitude;
        }
        const double waves = random.uniform(0.0, 0.02);
        std::vector<Vec3> rest = cloth.mesh.vertices;
        for (Vec3& v : rest) {
            v.y = waves * std::sin(25.0 * v.x) * std::cos(31.0 * v.z);
        }
        const Vec3 middle = random.in_cube(0.1);
        const std::vector<Vec3> start = placed(rest, attitude, middle - travel * random.uniform(0.3, 0.8));
        cloth.end = start;
        if (world.clearance(Vec3(0.0)) <= kRadius) {
            continue;
        }
        cloth.start = start;
        cloth.end = placed(rest, rotated, middle + travel * random.uniform(0.2, 0.7));
        world.refit();
        const Step s = step(world, Vec3(0.0), Vec3(0.0), kRadius);
        ASSERT_TRUE(s.crossings.empty()) << k;
        ASSERT_GE(world.clearance(s.moved.position), 0.998 * kRadius) << k;
        ASSERT_TRUE(s.standing.empty()) << k;
        touched += s.secure.touched ? 1 : 0;
        // A contact shallower than the shrink is left to the virtual proxy.
        missed += !s.secure.touched && touched_by_anything(cloth, Vec3(0.0), 0.9985 * kRadius) ? 1 : 0;
    }
    EXPECT_EQ(missed, 0);
    EXPECT_GT(touched, 30);
}

INSTANTIATE_TEST_SUITE_P(Of, Attitudes, testing::Values(Attitude::Random, Attitude::EdgeOn, Attitude::Tumbling));

TEST(SecurePosition, MeetsARimEdgeOnAtEveryOffset) {
    World world;
    Body& cloth = world.add(sheet(0.5, 16, true));
    for (int k = 0; k <= 18; ++k) {
        const double offset = 0.05 * k * kRadius;
        cloth.start = placed(cloth.mesh.vertices, kUpright, {-0.25 - kRadius - 0.01, offset, 0.011});
        cloth.end = placed(cloth.mesh.vertices, kUpright, {-0.25 - kRadius - 0.01 + kTravel, offset, 0.011});
        world.refit();
        const Step s = step(world, Vec3(0.0), Vec3(0.0), kRadius);
        ASSERT_TRUE(s.secure.touched) << offset;
        ASSERT_EQ(s.secure.first.feature, haptic::sim::Feature::Edge) << offset;
        ASSERT_TRUE(s.crossings.empty()) << offset;
        ASSERT_GE(world.clearance(s.moved.position), 0.999 * kRadius) << offset;
        ASSERT_GE(world.clearance(s.popped.position), 0.999 * kRadius) << offset;
    }
}

TEST(SecurePosition, AdvancesWithARotatingSheetWithoutBeingPassed) {
    World world;
    Body& cloth = world.add(sheet(0.5, 16, true));
    for (int k = 0; k < 60; ++k) {
        const double angle = -1.5 + 0.05 * k;
        const Vec3 axis = glm::normalize(Vec3(1.0, 0.0, 0.3));
        cloth.start = placed(cloth.mesh.vertices, kUpright, {0.02, 0.05, 0.01});
        cloth.end = placed(cloth.mesh.vertices, rotation(axis, angle), {0.02, -0.09, 0.01});
        world.refit();
        const Step s = step(world, Vec3(0.0), Vec3(0.0), kRadius);
        ASSERT_TRUE(s.secure.touched) << angle;
        ASSERT_TRUE(s.crossings.empty()) << angle;
        ASSERT_GE(world.clearance(s.popped.position), 0.999 * kRadius) << angle;
        ASSERT_LE(s.secure.advances, 5) << angle
                                        << ": the path beside the contact point stays outside the rotating face";
    }
}

TEST(SecurePosition, StaysOnItsSideOfASheetThatIsTurnedInsideOutInItsPlane) {
    // As flesh on the ground may be: the faces get the opposite normal where they have no area for a moment.
    World world;
    Body& flesh = world.add(sheet(1.0, 1, false));
    for (const double height : {0.5, 0.9, 0.999, 1.001}) {
        for (const double aside : {-0.1, 0.02, 0.3}) {
            flesh.start = placed(flesh.mesh.vertices, kUpright, {0.01, -height * kRadius, 0.013});
            flesh.end = flesh.start;
            for (Vec3& v : flesh.end) {
                v.x = -v.x;
            }
            world.refit();
            const Vec3 proxy(aside, 0.0, 0.05);
            const Step s = step(world, proxy, proxy, kRadius);
            ASSERT_TRUE(s.crossings.empty()) << height << " " << aside;
            ASSERT_TRUE(s.standing.empty()) << height << " " << aside;
            // At most with what it touches.
            ASSERT_LT(glm::length(s.secure.position - proxy), 2.0 * std::abs(aside) + kRadius)
                << height << " " << aside;
        }
    }
}

TEST(SecurePosition, IsOverconstrainedBetweenHammerAndAnvilButOnNoWrongSideWhileThereIsRoom) {
    for (const double gap : {0.05, 0.03, 0.01}) {
        World world;
        Body& floor = world.add(sheet(2.0, 4, false));
        Body& cloth = world.add(sheet(1.0, 32, true));
        floor.start = floor.end = placed(floor.mesh.vertices, kUpright, {0, -0.05, 0});
        cloth.start = placed(cloth.mesh.vertices, kUpright, {0.01, 0.06, 0.003});
        cloth.end = placed(cloth.mesh.vertices, kUpright, {0.01, -0.05 + gap, 0.003});
        world.refit();
        const Step s = step(world, Vec3(0.0), Vec3(0.0), kRadius);
        EXPECT_TRUE(s.secure.overconstrained) << gap;
        EXPECT_TRUE(s.standing.empty()) << gap;
        EXPECT_TRUE(s.crossings.empty()) << gap;
        EXPECT_GT(s.moved.position.y, -0.05) << gap;
        EXPECT_LT(s.moved.position.y, -0.05 + gap) << gap;
        EXPECT_NEAR(world.clearance(s.moved.position), 0.5 * gap, 0.1 * gap) << "in the middle of the room";
    }
}

TEST(SecurePosition, NamesTheHammerThatWouldFallThroughTheAnvil) {
    World world;
    Body& floor = world.add(sheet(2.0, 4, false));
    Body& cloth = world.add(sheet(1.0, 32, true));
    floor.start = floor.end = placed(floor.mesh.vertices, kUpright, {0, -0.05, 0});
    cloth.start = placed(cloth.mesh.vertices, kUpright, {0.01, 0.06, 0.003});
    cloth.end = placed(cloth.mesh.vertices, kUpright, {0.01, 0.06 - kTravel, 0.003});
    world.refit();
    const haptic::sim::SecurePosition secure = haptic::sim::secure_position(world.surfaces, Vec3(0.0), kRadius, {});
    EXPECT_TRUE(secure.overconstrained);
    EXPECT_TRUE(secure.no_room);
    EXPECT_EQ(secure.in_the_way.object, 1u) << "the cloth, not the floor";
    EXPECT_LE(secure.advances, 8) << "by decision, not because the advances ran out";
    EXPECT_EQ(secure.position, Vec3(0.0)) << "it has not moved";
    // Where the cloth stands still there is room.
    const Step s = step(world, Vec3(0.0), Vec3(0.0), kRadius);
    EXPECT_EQ(s.standing, std::vector<std::uint32_t>{1});
    EXPECT_FALSE(s.secure.no_room);
    EXPECT_TRUE(s.crossings.empty());
    EXPECT_GT(s.moved.position.y, -0.05);
    EXPECT_LT(s.moved.position.y, 0.06);
}

TEST(SecurePosition, IsTheSameForEveryOrderOfTriangles) {
    Random random(43);
    const haptic::sim::TriangleMesh mesh = sheet(0.5, 8, true);
    for (int k = 0; k < 20; ++k) {
        const Mat3 attitude = rotation(random.direction(), random.uniform(0.0, 3.0));
        const Mat3 rotated = rotation(random.direction(), 0.3) * attitude;
        const Vec3 travel = random.direction() * kTravel;
        Vec3 reference(0.0);
        for (int order = 0; order < 4; ++order) {
            haptic::sim::TriangleMesh shuffled = mesh;
            for (std::size_t j = mesh.triangles.size() - 1; order > 0 && j > 0; --j) {
                std::swap(shuffled.triangles[j], shuffled.triangles[random.below(static_cast<std::uint32_t>(j + 1))]);
            }
            World world;
            Body& cloth = world.add(shuffled);
            cloth.start = placed(mesh.vertices, attitude, -travel * 0.5);
            cloth.end = placed(mesh.vertices, rotated, travel * 0.5);
            world.refit();
            const Step s = step(world, Vec3(0.0), Vec3(0.0), kRadius, {}, false);
            if (order == 0) {
                reference = s.moved.position;
            }
            ASSERT_NEAR(glm::length(s.moved.position - reference), 0.0, 1e-9) << k;
        }
    }
}

TEST(SecurePosition, ScalesFromTenMetresToATenthOfAMillimetre) {
    for (const double scale : {1e-3, 1e-2, 1e2}) {
        Random random(44);
        World world;
        Body& cloth = world.add(sheet(0.5, 8, true));
        World small;
        Body& scaled = small.add(sheet(0.5 * scale, 8, true));
        for (int k = 0; k < 60; ++k) {
            const Mat3 attitude = rotation(random.direction(), random.uniform(0.0, 3.0));
            const Vec3 travel = random.direction() * kTravel;
            cloth.start = placed(cloth.mesh.vertices, attitude, -travel * 0.5);
            cloth.end = placed(cloth.mesh.vertices, attitude, travel * 0.5);
            scaled.start = cloth.start;
            scaled.end = cloth.end;
            for (std::size_t v = 0; v < cloth.start.size(); ++v) {
                scaled.start[v] *= scale;
                scaled.end[v] *= scale;
            }
            world.refit();
            small.refit();
            const Step one = step(world, Vec3(0.0), Vec3(0.0), kRadius, {}, false);
            const Step other = step(small, Vec3(0.0), Vec3(0.0), kRadius * scale, {}, false);
            ASSERT_EQ(one.secure.touched, other.secure.touched) << k << " at " << scale;
            ASSERT_NEAR(glm::length(one.secure.position - other.secure.position / scale), 0.0, 1e-7) << k;
        }
    }
}

TEST(SecurePosition, GivesTheSameBitsTwice) {
    World world;
    Body& cloth = world.add(sheet(0.5, 16, true));
    cloth.start = placed(cloth.mesh.vertices, rotation({0, 0, 1}, 0.3), {0, 0.07, 0});
    cloth.end = placed(cloth.mesh.vertices, rotation({0, 0, 1}, 0.5), {0, -0.07, 0});
    world.refit();
    const Step one = step(world, Vec3(0.0), Vec3(0.0), kRadius);
    const Step other = step(world, Vec3(0.0), Vec3(0.0), kRadius);
    EXPECT_EQ(one.moved.position, other.moved.position);
    EXPECT_EQ(one.secure.first_time, other.secure.first_time);
}

}  // namespace
