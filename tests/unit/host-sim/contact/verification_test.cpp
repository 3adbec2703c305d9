#include "contact/verification.hpp"

#include <gtest/gtest.h>

#include <array>
#include <span>
#include <utility>
#include <vector>

#include "contact/oracle.hpp"
#include "contact/scenes.hpp"

namespace {

using haptic::Vec3;
using haptic::sim::Crossing;
using haptic::sim::find_crossings;
using haptic::sim::PathKnot;
using haptic::sim::SurfaceMotion;
using haptic::sim::TriangleMesh;
using haptic::sim::oracle::Random;
using haptic::sim::scenes::Body;

std::vector<Crossing> check(const Body& body, std::vector<PathKnot> path) {
    const std::array<SurfaceMotion, 1> surfaces{body.motion()};
    return find_crossings(surfaces, path);
}

TEST(Verification, FiresOnAProxyThatWasTeleportedThroughASheet) {
    const Body sheet(haptic::sim::scenes::sheet(1.0, 8, false));
    const auto found = check(sheet, {{0.0, {0.01, 0.2, 0.02}}, {1.0, {0.03, -0.1, 0.02}}});
    ASSERT_EQ(found.size(), 1u);
    EXPECT_NEAR(found[0].time, 2.0 / 3.0, 1e-12);
    EXPECT_NEAR(found[0].position.y, 0.0, 1e-12);
}

TEST(Verification, FiresOnASheetThatFallsThroughARestingProxy) {
    Body sheet(haptic::sim::scenes::sheet(1.0, 8, false));
    for (std::size_t k = 0; k < sheet.end.size(); ++k) {
        sheet.start[k].y = 0.05;
        sheet.end[k].y = -0.09;
    }
    const auto found = check(sheet, {{0.0, {0.01, 0.0, 0.02}}, {1.0, {0.01, 0.0, 0.02}}});
    ASSERT_EQ(found.size(), 1u);
    EXPECT_NEAR(found[0].time, 0.05 / 0.14, 1e-12);
}

TEST(Verification, CountsADoubleFacedSheetOnce) {
    const Body sheet(haptic::sim::scenes::sheet(1.0, 8, true));
    EXPECT_EQ(check(sheet, {{1.0, {0.01, 0.2, 0.02}}, {1.0, {0.03, -0.1, 0.02}}}).size(), 1u);
}

TEST(Verification, CountsThereAndBackTwice) {
    const Body sheet(haptic::sim::scenes::sheet(1.0, 8, true));
    EXPECT_EQ(check(sheet, {{0.0, {0.01, 0.2, 0.02}}, {0.5, {0.03, -0.1, 0.02}}, {1.0, {0.03, 0.1, 0.02}}}).size(), 2u);
}

TEST(Verification, LetsTheProxyPassAroundTheBorder) {
    const Body sheet(haptic::sim::scenes::sheet(1.0, 8, true));
    EXPECT_TRUE(
        check(sheet, {{0.0, {0.4, 0.2, 0.0}}, {0.3, {0.6, 0.1, 0.0}}, {0.6, {0.6, -0.1, 0.0}}, {1.0, {0.2, -0.1, 0.0}}})
            .empty());
}

TEST(Verification, LetsTheProxyAdvanceWithARotatingSheet) {
    // The sheet rotates by 40 degrees about x while the proxy keeps 0.03 above it, in 20 straight pieces.
    Body sheet(haptic::sim::scenes::sheet(1.0, 8, true));
    sheet.end =
        haptic::sim::scenes::placed(sheet.mesh.vertices, haptic::sim::scenes::rotation({1, 0, 0}, 0.7), {0, -0.3, 0});
    std::vector<PathKnot> path;
    for (int k = 0; k <= 20; ++k) {
        const double t = k / 20.0;
        const auto at = [&](std::size_t v) { return (1.0 - t) * sheet.start[v] + t * sheet.end[v]; };
        const Vec3 n = glm::normalize(glm::cross(at(1) - at(0), at(9) - at(0)));
        path.push_back({t, at(12) + 0.03 * n});
    }
    EXPECT_TRUE(check(sheet, path).empty());
    path.back().position = sheet.end[12] * 2.0 - path.back().position;
    EXPECT_FALSE(check(sheet, path).empty()) << "mirrored through the sheet at the end";
}

TEST(Verification, SeesASheetThatCutsEdgeOnThroughTheCentre) {
    Body sheet(haptic::sim::scenes::sheet(1.0, 4, false));
    for (std::size_t k = 0; k < sheet.end.size(); ++k) {
        sheet.start[k].x -= 0.6;
        sheet.end[k].x -= 0.3;
    }
    EXPECT_FALSE(check(sheet, {{0.0, {0, 0, 0.01}}, {1.0, {0, 0, 0.01}}}).empty());
    EXPECT_TRUE(check(sheet, {{0.0, {0, 1e-6, 0.01}}, {1.0, {0, 1e-6, 0.01}}}).empty());
}

TEST(Verification, AgreesWithTheWindingNumberOnRandomPathsThroughABall) {
    Random random(8);
    const Body ball(haptic::sim::scenes::ball(0.5, 6));
    int through = 0;
    for (int k = 0; k < 500; ++k) {
        const Vec3 from = random.in_cube(0.8);
        const Vec3 to = random.in_cube(0.8);
        const double before = haptic::sim::winding_number(ball.end, ball.mesh.triangles, from);
        const double after = haptic::sim::winding_number(ball.end, ball.mesh.triangles, to);
        ASSERT_NEAR(before, std::round(before), 1e-9);
        const auto found = check(ball, {{1.0, from}, {1.0, to}});
        ASSERT_EQ(found.size() % 2, static_cast<std::size_t>(std::abs(std::lround(after - before)))) << k;
        through += found.empty() ? 0 : 1;
    }
    EXPECT_GT(through, 100);
}

/// Several bodies that move and deform, and paths of several pieces among them, `away` from the origin.
struct Crowd {
    Crowd(Random& random, const Vec3& away) {
        for (const TriangleMesh& mesh : {haptic::sim::scenes::ball(0.3, 4), haptic::sim::scenes::sheet(1.2, 6, true)}) {
            Body body(mesh);
            const Vec3 shift = away + random.in_cube(0.3);
            const Vec3 travel = random.in_cube(0.4);
            for (std::size_t v = 0; v < body.start.size(); ++v) {
                body.start[v] += shift + random.in_cube(0.02);
                body.end[v] += shift + travel + random.in_cube(0.02);
            }
            bodies.push_back(std::move(body));
        }
        for (const Body& body : bodies) {
            motions.push_back(body.motion());
        }
        for (int k = 0; k < 9; ++k) {
            std::vector<PathKnot> knots{{0.0, away + random.in_cube(0.7)}};
            const double size = random.uniform(0.0, 0.3);
            for (const double time : {0.0, 0.4, 0.7, 1.0, 1.0}) {
                knots.push_back({time, knots.back().position + random.in_cube(size)});
            }
            paths.push_back(knots);
        }
        paths.push_back({{0.0, away}});  // without a piece
    }
    [[nodiscard]] std::vector<std::span<const PathKnot>> spans() const { return {paths.begin(), paths.end()}; }

    std::vector<Body> bodies;
    std::vector<SurfaceMotion> motions;  // of the bodies, at their present positions
    std::vector<std::vector<PathKnot>> paths;
};

TEST(Verification, OfManyPathsTogetherIsThatOfEachAlone) {
    Random random(10);
    std::size_t crossings = 0;
    for (const double away : {0.0, 1e7}) {  // numbers there are 2e-9 m apart
        for (int round = 0; round < 60; ++round) {
            const Crowd crowd(random, Vec3(away, -away, 0.5 * away));
            const auto together = find_crossings(crowd.motions, crowd.spans());
            ASSERT_EQ(together.size(), crowd.paths.size());
            for (std::size_t k = 0; k < crowd.paths.size(); ++k) {
                const auto alone = find_crossings(crowd.motions, std::span<const PathKnot>(crowd.paths[k]));
                ASSERT_EQ(together[k].size(), alone.size()) << "away " << away << ", round " << round << ", path " << k;
                for (std::size_t c = 0; c < alone.size(); ++c) {
                    EXPECT_EQ(together[k][c].object, alone[c].object);
                    EXPECT_EQ(together[k][c].triangle, alone[c].triangle);
                    EXPECT_EQ(together[k][c].piece, alone[c].piece);
                    EXPECT_EQ(together[k][c].time, alone[c].time);
                    EXPECT_EQ(together[k][c].position, alone[c].position);
                }
                crossings += alone.size();
            }
        }
    }
    EXPECT_GT(crossings, 200u);
}

TEST(Verification, OfAPathThatOnlyRoundingBringsOntoASurfaceIsTheSameTogether) {
    // At equal heights at both ends of the step, a resting sheet is interpolated to where rounding puts it between
    // them, which may be beyond both.
    int rounded = 0;
    for (int k = 1; k < 100; ++k) {
        const double height = 0.3;
        const double time = 0.01 * k;
        const double between = (1.0 - time) * height + time * height;
        if (between == height) {
            continue;
        }
        ++rounded;
        Body sheet(haptic::sim::scenes::sheet(1.0, 4, false));
        for (std::size_t v = 0; v < sheet.end.size(); ++v) {
            sheet.start[v].y = sheet.end[v].y = height;
        }
        const double away = between < height ? -0.1 : 0.1;
        const std::array<SurfaceMotion, 1> surfaces{sheet.motion()};
        const std::array<PathKnot, 2> path{PathKnot{time, {0.01, between, 0.02}},
                                           PathKnot{time, {0.01, between + away, 0.02}}};
        const std::array<std::span<const PathKnot>, 1> paths{path};
        ASSERT_EQ(find_crossings(surfaces, path).size(), 1u) << k;
        EXPECT_EQ(find_crossings(surfaces, paths)[0].size(), 1u) << k;
    }
    EXPECT_GT(rounded, 3);
}

TEST(Verification, AgreesWithTheSignedHeightOverRandomMotionsOfOneTriangle) {
    // A large triangle about the point: the point passes through where its height changes sign an odd number of times.
    Random random(9);
    int passages = 0;
    for (int k = 0; k < 2000; ++k) {
        const std::vector<haptic::sim::Triangle> one{{0, 1, 2}};
        std::vector<Vec3> start;
        std::vector<Vec3> end;
        const Vec3 shift(0, random.uniform(-1, 1), 0);
        const Vec3 shift_end(0, random.uniform(-1, 1), 0);
        for (const Vec3& corner : {Vec3(-50, 0, -50), Vec3(50, 0, -50), Vec3(0, 0, 50)}) {
            start.push_back(corner + shift + random.in_cube(0.3));
            end.push_back(corner + shift_end + random.in_cube(0.3));
        }
        const auto height = [](const std::vector<Vec3>& x) {
            return glm::dot(glm::cross(x[1] - x[0], x[2] - x[0]), -x[0]);
        };
        const bool odd = height(start) * height(end) < 0.0;
        const std::array<SurfaceMotion, 1> surfaces{SurfaceMotion{start, end, one}};
        const std::array<PathKnot, 2> path{PathKnot{0.0, Vec3(0.0)}, PathKnot{1.0, Vec3(0.0)}};
        ASSERT_EQ(find_crossings(surfaces, path).size(), odd ? 1u : 0u) << k;
        passages += odd ? 1 : 0;
    }
    EXPECT_GT(passages, 500);
}

}  // namespace
