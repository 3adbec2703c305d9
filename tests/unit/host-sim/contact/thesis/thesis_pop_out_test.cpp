#include "contact/thesis/thesis_pop_out.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "contact/oracle.hpp"
#include "contact/scenes.hpp"
#include "contact/tight_places.hpp"
#include "reproduce/pop_out_table.hpp"

namespace {

using haptic::Mat3;
using haptic::Vec3;
using haptic::sim::ContactSettings;
using haptic::sim::in_range_triangle;
using haptic::sim::InRangeTriangle;
using haptic::sim::ListPopOut;
using haptic::sim::PopOut;
using haptic::sim::PopOutMethod;
using haptic::sim::ProxyPath;
using haptic::sim::TriangleMesh;
using haptic::sim::oracle::Random;
using haptic::sim::scenes::Body;
using haptic::sim::scenes::kRadius;
using haptic::sim::scenes::placed;
using haptic::sim::scenes::sheet;
using haptic::sim::scenes::World;
using haptic::sim::tight::clipped_wall;
using haptic::sim::tight::fan;
using haptic::sim::tight::shuffle;

ContactSettings thesis_pop_out() {
    ContactSettings settings;
    settings.pop_out = PopOutMethod::Thesis;
    return settings;
}

/// A triangle in the plane y = height, so wide that the closest point to anything near the origin is on its face.
InRangeTriangle level(double height) {
    return in_range_triangle({{-1.0, height, -1.0}, {-1.0, height, 2.0}, {2.0, height, -1.0}});
}

TEST(ThesisPopOut, PopsToTheFullRadiusFromWhatIsPenetrated) {
    const std::vector<InRangeTriangle> list{level(0.0)};
    const ListPopOut p = pop_out_of_list(list, {0.01, 0.4 * kRadius, 0.02}, kRadius, thesis_pop_out());
    EXPECT_NEAR(glm::length(p.position - Vec3(0.01, kRadius, 0.02)), 0.0, 1e-15);
    EXPECT_EQ(p.iterations, 1);
    EXPECT_EQ(p.pops, 1);
    EXPECT_TRUE(p.clear);
}

TEST(ThesisPopOut, LeavesWhatIsOnlyWithinTheShrink) {
    const std::vector<InRangeTriangle> list{level(0.0)};
    const Vec3 at(0.0, 0.9995 * kRadius, 0.0);
    const ListPopOut p = pop_out_of_list(list, at, kRadius, thesis_pop_out());
    EXPECT_EQ(p.position, at);
    EXPECT_EQ(p.iterations, 0);
}

TEST(ThesisPopOut, NeverPopsByLessThanTheMinimum) {
    ContactSettings settings = thesis_pop_out();
    settings.shrink = 0.99999;
    settings.pop_out_minimum = 0.05;
    const std::vector<InRangeTriangle> list{level(0.0)};
    const ListPopOut p = pop_out_of_list(list, {0.0, 0.9999 * kRadius, 0.0}, kRadius, settings);
    EXPECT_NEAR(p.position.y, (0.9999 + 0.05) * kRadius, 1e-15);
}

TEST(ThesisPopOut, PopsACentreOnATriangleAlongItsNormal) {
    const std::vector<InRangeTriangle> list{level(0.0)};
    const ListPopOut p = pop_out_of_list(list, {0.0, 0.0, 0.0}, kRadius, thesis_pop_out());
    EXPECT_NEAR(p.position.y, kRadius, 1e-15);
}

TEST(ThesisPopOut, TakesEachTriangleInTurnFromWhereTheLastOneLeftIt) {
    // A wedge of two planes: line 11 by hand, for both orders.
    const InRangeTriangle floor = level(0.0);
    const InRangeTriangle slope = in_range_triangle({{-1.0, -1.0, -1.0}, {2.0, 2.0, -1.0}, {-1.0, -1.0, 2.0}});
    const Vec3 start(-0.5 * kRadius, 0.5 * kRadius, 0.0);
    ContactSettings settings = thesis_pop_out();
    settings.pop_out_limit = 1;
    const Vec3 up(0, 1, 0);
    const Vec3 aside = glm::normalize(Vec3(-1, 1, 0));
    const auto pop = [](Vec3 p, const Vec3& n) {
        const double height = glm::dot(p, n);
        return height < 0.999 * kRadius ? p + n * (kRadius - height) : p;
    };
    const Vec3 floor_first = pop(pop(start, up), aside);
    const Vec3 slope_first = pop(pop(start, aside), up);
    ASSERT_GT(glm::length(floor_first - slope_first), 1e-4);
    const std::vector<InRangeTriangle> one{floor, slope};
    const std::vector<InRangeTriangle> two{slope, floor};
    EXPECT_NEAR(glm::length(pop_out_of_list(one, start, kRadius, settings).position - floor_first), 0.0, 1e-15);
    EXPECT_NEAR(glm::length(pop_out_of_list(two, start, kRadius, settings).position - slope_first), 0.0, 1e-15);
}

TEST(ThesisPopOut, PopsFromTheNearestPointOfAnyTriangle) {
    Random random(58);
    ContactSettings settings = thesis_pop_out();
    settings.pop_out_limit = 1;
    settings.pop_out_minimum = 0.0;
    int popped = 0;
    for (int k = 0; k < 20000; ++k) {
        haptic::sim::oracle::Corners c{random.in_cube(1.0), random.in_cube(1.0), random.in_cube(1.0)};
        if (k % 10 == 0) {
            c[2] = c[0] + (c[1] - c[0]) * random.uniform(-1.0, 2.0);  // a line
        } else if (k % 10 == 1) {
            c[1] = c[2] = c[0];  // a point
        }
        const Vec3 p = random.in_cube(1.0);
        const std::vector<InRangeTriangle> list{in_range_triangle({c[0], c[1], c[2]})};
        const double before = haptic::sim::oracle::distance(p, c);
        const double radius = 0.5;
        const ListPopOut q = pop_out_of_list(list, p, radius, settings);
        if (before >= 0.999 * radius) {
            ASSERT_EQ(q.position, p) << k;
            continue;
        }
        ++popped;
        // Straight away from the closest point: displacement and initial distance add up to the radius.
        ASSERT_NEAR(haptic::sim::oracle::distance(q.position, c), radius, 1e-9) << k;
        ASSERT_NEAR(glm::length(q.position - p), radius - before, 1e-9) << k;
    }
    EXPECT_GT(popped, 4000);
}

TEST(ThesisPopOut, LooksNoFartherThanTheDetectionRange) {
    // The wall pops the proxy 0.9 radii to the right, into a second wall that was 1.5 radii away.
    World world;
    const Mat3 upright = haptic::sim::scenes::rotation({0, 0, 1}, M_PI / 2);
    for (const double x : {-0.1 * kRadius, 1.5 * kRadius}) {
        Body& wall = world.add(sheet(0.2, 1, false));
        wall.start = wall.end = placed(wall.mesh.vertices, upright, {x, 0, 0});
    }
    world.refit();
    ContactSettings settings = thesis_pop_out();
    settings.pop_out_limit = 7;
    settings.detection_range = 1.4;
    const PopOut blind = pop_out(world.surfaces, Vec3(0.0), kRadius, settings);
    EXPECT_EQ(blind.iterations, 1);
    EXPECT_TRUE(blind.overconstrained) << "it does not know of the second wall, but it says that it is not clear";
    EXPECT_NEAR(blind.clearance, 0.6 * kRadius, 1e-12);
    settings.detection_range = 2.01;
    EXPECT_EQ(pop_out(world.surfaces, Vec3(0.0), kRadius, settings).iterations, 7);
}

TEST(ThesisPopOut, GetsClearOfAFanInTheEnd) {
    Random random(52);
    for (const double depth : {1.0, 2.0, 3.0}) {
        World world;
        world.add(fan(4.0, depth));
        world.refit();
        int max_iterations = 0;
        for (int k = 0; k < 100; ++k) {
            const double height = random.uniform(1.5, 3.0) * kRadius;
            const Vec3 p = Vec3(0.0, -depth + height, 0.0) + random.in_cube(0.1 * kRadius);
            const PopOut popped = pop_out(world.surfaces, p, kRadius, thesis_pop_out());
            EXPECT_FALSE(popped.overconstrained) << depth << " " << k;
            EXPECT_GE(world.clearance(popped.position), 0.999 * kRadius * (1.0 - 1e-12)) << depth << " " << k;
            max_iterations = std::max(max_iterations, popped.iterations);
        }
        RecordProperty("most_iterations_at_depth_" + std::to_string(static_cast<int>(depth)), max_iterations);
    }
}

// The three cases of figure 4.19 of the thesis, in which Algorithm 2 may fail according to section 4.6.1.
// pop_out_test.cpp shows that the default method does not.

TEST(ThesisPopOut, IsOnTheWrongSideOfAThinWallWhenATriangleThatClipsComesFirst) {
    Random random(53);
    int wrong = 0;
    int right = 0;
    TriangleMesh mesh = clipped_wall(4);
    for (int k = 0; k < 1000; ++k) {
        shuffle(mesh, random);
        World world;
        world.add(mesh);
        world.refit();
        const double x = pop_out(world.surfaces, haptic::sim::tight::kBesideWall, kRadius, thesis_pop_out()).position.x;
        (x > 0.0 ? right : wrong) += 1;
    }
    EXPECT_GT(wrong, 100) << "the centre began at x > 0, on the right of the wall";
    EXPECT_GT(right, 100) << "so the end depends on the order of triangles";
}

TEST(ThesisPopOut, IsHelpedInThatCaseByTheHalfSpaceCondition) {
    Random random(54);
    ContactSettings settings = thesis_pop_out();
    settings.half_space = true;
    TriangleMesh mesh = clipped_wall(4);
    for (int k = 0; k < 1000; ++k) {
        shuffle(mesh, random);
        World world;
        world.add(mesh);
        world.refit();
        const PopOut popped = pop_out(world.surfaces, haptic::sim::tight::kBesideWall, kRadius, settings);
        // Inner edges of the wall push it aside a little, so it is not exactly one radius.
        ASSERT_NEAR(popped.position.x, kRadius, 2e-3 * kRadius) << k;
        ASSERT_TRUE(popped.overconstrained) << "what it did not look at still clips it";
    }
}

TEST(ThesisPopOut, IsStuckBetweenParallelFacesAndEndsAtTheLastOneOfTheList) {
    for (const bool lower_first : {true, false}) {
        World world = haptic::sim::tight::slit(0.7 * kRadius, lower_first);
        for (const int limit : {10, 100, 1000}) {
            ContactSettings settings = thesis_pop_out();
            settings.pop_out_limit = limit;
            static ProxyPath path;
            path.restart({0, 0.002, 0});
            const PopOut popped = pop_out(world.surfaces, {0, 0.002, 0}, kRadius, settings, &path);
            EXPECT_EQ(popped.iterations, limit);
            EXPECT_TRUE(popped.overconstrained);
            EXPECT_TRUE(path.complete());
            EXPECT_NEAR(popped.position.y, lower_first ? -0.3 * kRadius : 0.3 * kRadius, 0.01 * kRadius);
        }
    }
}

TEST(ThesisPopOut, IsPoppedThroughOneOfTwoParallelFacesThatAreNearerThanARadius) {
    World world = haptic::sim::tight::slit(0.45 * kRadius, true);
    static ProxyPath path;
    path.restart({0, 0.0, 0});
    const PopOut popped = pop_out(world.surfaces, {0, 0.0, 0}, kRadius, thesis_pop_out(), &path);
    EXPECT_GT(popped.position.y, 0.45 * kRadius);
    EXPECT_FALSE(popped.overconstrained) << "it thinks that all is well";
    EXPECT_FALSE(find_crossings(world.motions(), path.knots()).empty());
}

TEST(ThesisPopOut, IsPoppedOutOfAPocketThatIsTooSmall) {
    Random random(55);
    TriangleMesh mesh = haptic::sim::scenes::box(haptic::sim::tight::kPocket);
    int outside = 0;
    for (int k = 0; k < 200; ++k) {
        shuffle(mesh, random);
        World world;
        world.add(mesh);
        world.refit();
        const PopOut popped = pop_out(world.surfaces, haptic::sim::tight::kInPocket, kRadius, thesis_pop_out());
        const bool inside = std::abs(haptic::sim::winding_number(mesh.vertices, mesh.triangles, popped.position)) > 0.5;
        EXPECT_TRUE(!inside || popped.overconstrained) << k;
        outside += inside ? 0 : 1;
    }
    EXPECT_GT(outside, 50);
}

TEST(ThesisPopOut, LosesItsSideWhereTheProxyIsDeeperThanItsRadius) {
    // The centre itself has passed the sheet, and nothing in Algorithm 2 remembers where it came from.
    World world;
    world.add(sheet(1.0, 8, true));
    world.refit();
    const PopOut popped = pop_out(world.surfaces, {0.01, -0.1 * kRadius, 0.02}, kRadius, thesis_pop_out());
    EXPECT_NEAR(popped.position.y, -kRadius, 2e-3 * kRadius);
}

TEST(ThesisPopOut, MakesEveryIterationOfTheTableAndTakesEachOfItsBranchesThere) {
    for (const int count : {10, 20, 30}) {
        const auto triangles = haptic::sim::pop_out_table_triangles(count);
        ASSERT_EQ(triangles.size(), static_cast<std::size_t>(count));
        std::array<int, 4> kinds{};
        for (const InRangeTriangle& t : triangles) {
            const auto nearest =
                haptic::sim::closest_point_on_triangle(Vec3(0.0), {t.edges[0].from, t.edges[1].from, t.edges[2].from});
            const double distance = std::sqrt(nearest.squared_distance);
            EXPECT_LT(distance, 2.01 * haptic::sim::kPopOutTableRadius);
            kinds[distance < kRadius ? static_cast<std::size_t>(nearest.feature) : 0] += 1;
        }
        for (const int kind : kinds) {
            EXPECT_GE(kind, count / 8 * 2 - 1);
        }
        ContactSettings settings = thesis_pop_out();
        settings.pop_out_limit = 50;
        const ListPopOut p = pop_out_of_list(triangles, Vec3(0.0), kRadius, settings);
        EXPECT_EQ(p.iterations, 50);
        EXPECT_FALSE(p.clear);
        EXPECT_GE(p.pops, 50 * (count - kinds[0]) - 1) << "every triangle but those far off, in every pass";
    }
}

TEST(ThesisPopOut, FillsTheTableOfTheThesis) {
    static std::int64_t time = 0;
    const auto table = haptic::sim::measure_pop_out_table([] { return time += 5'000'000; });
    ASSERT_EQ(table.size(), 9u);
    EXPECT_EQ(table[0].triangles, 10);
    EXPECT_EQ(table[0].iterations, 10);
    EXPECT_EQ(table[8].triangles, 30);
    EXPECT_EQ(table[8].iterations, 1000);
    EXPECT_EQ(table[5].thesis_ms, 1.533);
    for (const auto& t : table) {
        EXPECT_NEAR(t.ms, 0.5, 1e-12) << "5 ms by this clock, over ten repetitions";
    }
}

TEST(ThesisPopOut, SaysWhatRoomIsLeftAlsoWhenMoreThanItsListHoldsAreInRange) {
    World world;
    world.add(sheet(0.06, 24, true));
    world.refit();
    ASSERT_GT(world.bodies[0]->mesh.triangles.size(), 4 * haptic::sim::kMaxInRange);
    const PopOut popped = pop_out(world.surfaces, {0.0003, 0.3 * kRadius, 0.0002}, kRadius, thesis_pop_out());
    const double clearance = std::min(kRadius, world.clearance(popped.position));
    EXPECT_NEAR(popped.clearance, clearance, 1e-12);
    EXPECT_EQ(popped.overconstrained, clearance < 0.999 * kRadius);
    EXPECT_GT(popped.position.y, 0.9 * kRadius) << "the nearest were in the list";
}

}  // namespace
