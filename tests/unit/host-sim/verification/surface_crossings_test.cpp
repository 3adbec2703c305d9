#include "verification/surface_crossings.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include "contact/oracle.hpp"
#include "contact/scenes.hpp"

namespace {

using haptic::Mat3;
using haptic::Vec3;
using haptic::sim::CheckedSurface;
using haptic::sim::find_ground_crossings;
using haptic::sim::rounding_of;
using haptic::sim::SurfaceCrossing;
using haptic::sim::SurfaceCrossings;
using haptic::sim::Triangle;
using haptic::sim::TriangleMesh;
using haptic::sim::oracle::Random;
namespace scenes = haptic::sim::scenes;

/// Several bodies and their common vertices.
struct Surfaces {
    Surfaces& add(const TriangleMesh& mesh, const Vec3& shift = Vec3(0.0), const Mat3& turn = Mat3(1.0)) {
        parts.push_back({mesh.triangles, vertices.size()});
        for (const Vec3& v : mesh.vertices) {
            vertices.push_back(turn * v + shift);
        }
        return *this;
    }
    [[nodiscard]] std::vector<SurfaceCrossing> crossings() const {
        std::vector<CheckedSurface> surfaces;
        surfaces.reserve(parts.size());
        for (const Part& part : parts) {
            surfaces.push_back({part.triangles, part.first_vertex});
        }
        SurfaceCrossings finder(surfaces, vertices);
        const auto found = finder.find(vertices, rounding_of(vertices));
        return {found.begin(), found.end()};
    }
    [[nodiscard]] std::size_t count() const { return crossings().size(); }

    struct Part {
        std::vector<Triangle> triangles;
        std::size_t first_vertex;
    };
    std::vector<Part> parts;
    std::vector<Vec3> vertices;
};

TriangleMesh mesh_of(std::vector<Vec3> vertices, std::vector<Triangle> triangles) {
    TriangleMesh mesh;
    mesh.vertices = std::move(vertices);
    mesh.triangles = std::move(triangles);
    return mesh;
}

TriangleMesh two_triangles(std::vector<Vec3> corners) {
    return mesh_of(std::move(corners), {{0, 1, 2}, {3, 4, 5}});
}

/// Open tube along y, of radius 0.2 and length 1: 12 around, `rings` rows of squares.
TriangleMesh upright_tube(std::uint32_t rings) {
    TriangleMesh mesh;
    constexpr std::uint32_t around = 12;
    for (std::uint32_t i = 0; i <= rings; ++i) {
        for (std::uint32_t j = 0; j < around; ++j) {
            const double angle = 2.0 * M_PI * j / around;
            mesh.vertices.emplace_back(0.2 * std::cos(angle), i / static_cast<double>(rings) - 0.5,
                                       0.2 * std::sin(angle));
        }
    }
    for (std::uint32_t i = 0; i < rings; ++i) {
        for (std::uint32_t j = 0; j < around; ++j) {
            const std::uint32_t a = i * around + j;
            const std::uint32_t b = i * around + (j + 1) % around;
            mesh.triangles.push_back({a, a + around, b});
            mesh.triangles.push_back({b, a + around, b + around});
        }
    }
    return mesh;
}

TEST(SurfaceCrossings, AnEdgeThroughAFaceCountsOnceAndIsNamed) {
    const auto found = Surfaces()
                           .add(two_triangles({{-1, 0, -1}, {1, 0, -1}, {0, 0, 2}, {0, -1, 0}, {0, 1, 0}, {9, 1, 0}}))
                           .crossings();
    // The edge from vertex 3 to 4 pierces the first triangle, whose border pierces the second one.
    ASSERT_EQ(found.size(), 2u);
    EXPECT_EQ(found[0].edge, (std::array<std::uint32_t, 2>{1, 2}));
    EXPECT_EQ(found[0].triangle, 1u);
    EXPECT_EQ(found[1].edge, (std::array<std::uint32_t, 2>{3, 4}));
    EXPECT_EQ(found[1].triangle, 0u);
    EXPECT_NEAR(glm::length(found[1].position), 0.0, 1e-15);
}

TEST(SurfaceCrossings, TwoLinkedTrianglesCrossTwice) {
    // Each has one edge through the other, or one has two.
    EXPECT_EQ(
        Surfaces().add(two_triangles({{0, 0, -1}, {0, 0, 1}, {2, 0.1, 0}, {1, -1, 0}, {1, 1, 0.2}, {9, 0, 0}})).count(),
        2u);
    EXPECT_EQ(
        Surfaces().add(two_triangles({{0, 0, -1}, {0, 0, 1}, {2, 0.1, 0}, {3, -1, 0}, {3, 1, 0.2}, {9, 0, 0}})).count(),
        0u)
        << "beside one another";
}

TEST(SurfaceCrossings, TouchingIsNoCrossing) {
    const std::vector<Vec3> face{{-1, 0, -1}, {1, 0, -1}, {0, 0, 2}};
    const auto with = [&](const Vec3& a, const Vec3& b, const Vec3& c) {
        std::vector<Vec3> corners = face;
        corners.insert(corners.end(), {a, b, c});
        return Surfaces().add(two_triangles(corners)).count();
    };
    EXPECT_EQ(with({0, 0, 0}, {0.1, 1, 0}, {-0.1, 1, 0}), 0u) << "a corner on the face";
    EXPECT_EQ(with({0.1, 0, 0}, {-0.1, 0, 0}, {0, 1, 0}), 0u) << "an edge on the face";
    EXPECT_EQ(with({0.1, 0, 0}, {-0.1, 0, 0}, {0, 0, 0.1}), 0u) << "in the face's plane, inside";
    EXPECT_EQ(with({0.1, 0, 0}, {-0.1, 0, 9}, {0, 0, -9}), 0u) << "in the face's plane, across its border";
    EXPECT_EQ(with({0, -1, -1}, {0, 1, -1}, {0, 1, -3}), 0u) << "border on border";
    EXPECT_EQ(with({0, -1, 2}, {0, 1, 2}, {0, 1, 4}), 0u) << "border on a corner";
    EXPECT_EQ(with({0, 1e-17, 0}, {0.1, 1, 0}, {-0.1, 1, 0}), 0u) << "by rounding above";
    EXPECT_EQ(with({0, -1e-17, 0}, {0.1, 1, 0}, {-0.1, 1, 0}), 0u) << "by rounding below";
    EXPECT_EQ(with({0, -1e-12, 0}, {0.1, 1, 0}, {-0.1, 1, 0}), 2u) << "deeper than rounding";
}

TEST(SurfaceCrossings, NeighboursThatShareAVertexOrAnEdgeDoNotCross) {
    EXPECT_EQ(Surfaces().add(scenes::sheet(1.0, 8, false)).count(), 0u);
    EXPECT_EQ(Surfaces().add(scenes::ball(1.0, 8)).count(), 0u);
    EXPECT_EQ(Surfaces().add(scenes::box(Vec3(0.5))).count(), 0u);
    // A fold so sharp that neighbours lie on one another.
    TriangleMesh folded = scenes::sheet(1.0, 8, true);
    for (Vec3& v : folded.vertices) {
        v.x = std::abs(v.x);
    }
    EXPECT_EQ(Surfaces().add(folded).count(), 0u);
}

TEST(SurfaceCrossings, FlatMeshesInAnyAttitudeDoNotCrossByRounding) {
    Random random(3);
    for (int k = 0; k < 50; ++k) {
        // Hanging vertices: a fine sheet whose border lies on that of a coarse one, in the same plane.
        const Mat3 turn = scenes::rotation(glm::normalize(random.in_cube(1.0)), random.uniform(0, 6));
        const Vec3 shift = random.in_cube(3.0);
        Surfaces both;
        both.add(scenes::sheet(1.0, 3, true), shift, turn).add(scenes::sheet(1.0, 7, true), shift + turn[0], turn);
        ASSERT_EQ(both.count(), 0u) << k;
        // Two sheets that lie on one another.
        both.add(scenes::sheet(1.0, 4, true), shift, turn);
        ASSERT_EQ(both.count(), 0u) << k;
    }
}

TEST(SurfaceCrossings, TheSecondFaceOfASheetAddsNothing) {
    const Mat3 turn = scenes::rotation({1, 0, 0}, 1.1);
    std::vector<std::size_t> counts;
    for (const bool double_faced : {false, true}) {
        counts.push_back(Surfaces()
                             .add(scenes::sheet(1.0, 6, double_faced))
                             .add(scenes::sheet(0.7, 5, double_faced), {0.03, 0.02, 0.01}, turn)
                             .count());
    }
    EXPECT_GT(counts[0], 5u);
    EXPECT_EQ(counts[0], counts[1]);
}

TEST(SurfaceCrossings, ADoubleFacedSheetFoldedOntoItselfCrossesOnlyWhereItPassesThroughItself) {
    // Folded over at x = 0, the upper half 2 mm above the lower one and tilted: up to 1.5 mm, then to 3 mm, downward.
    for (const double tilt : {0.0, 0.003, 0.006}) {
        TriangleMesh sheet = scenes::sheet(1.0, 10, true);
        for (Vec3& v : sheet.vertices) {
            if (v.x > 0.05) {
                v = {0.133 - v.x, 0.002 + tilt * v.z, v.z + 0.007};
            }
        }
        const std::size_t found = Surfaces().add(sheet).count();
        EXPECT_EQ(found > 0, tilt == 0.006) << tilt << ": " << found;
    }
}

TEST(SurfaceCrossings, ATubeThroughAPlateCrossesAllAround) {
    // 12 edges along the tube and 12 across its squares pierce the plate, whose edges pierce no tube.
    const Mat3 still(1.0);
    const TriangleMesh plate = mesh_of({{-1, 0, -1}, {1, 0, -1}, {0, 0, 3}}, {{0, 1, 2}});
    EXPECT_EQ(Surfaces().add(plate).add(upright_tube(3), {0, 0.01, 0}, still).count(), 24u);
    EXPECT_EQ(Surfaces().add(plate).add(upright_tube(3), {0, 0.5, 0}, still).count(), 0u) << "stands on it";
    EXPECT_EQ(Surfaces().add(plate).add(upright_tube(3), {0, 0.51, 0}, still).count(), 0u) << "above it";
    const auto found = Surfaces().add(plate).add(upright_tube(3), {0, 0.01, 0}, still).crossings();
    for (const SurfaceCrossing& crossing : found) {
        EXPECT_EQ(crossing.edge_object, 1u);
        EXPECT_EQ(crossing.object, 0u);
        EXPECT_NEAR(crossing.position.y, 0.0, 1e-15);
        EXPECT_LE(std::hypot(crossing.position.x, crossing.position.z), 0.2 + 1e-15);
    }
}

TEST(SurfaceCrossings, SurfacesThatMeetExactlyAtVerticesAndEdgesCrossIfTheyPassThrough) {
    // A ring of vertices in the plate's plane: one crossing for each of the 12.
    const TriangleMesh plate = mesh_of({{-1, 0, -1}, {1, 0, -1}, {0, 0, 3}}, {{0, 1, 2}});
    EXPECT_EQ(Surfaces().add(plate).add(upright_tube(2)).count(), 12u);
    // Boxes on a common grid: edges meet the diagonals of faces.
    EXPECT_GT(Surfaces().add(scenes::box(Vec3(1.0))).add(scenes::box(Vec3(1.0)), Vec3(1.0)).count(), 0u);
    EXPECT_EQ(Surfaces().add(scenes::box(Vec3(1.0))).add(scenes::box(Vec3(1.0)), {2, 0, 0}).count(), 0u)
        << "face on face";
    // An edge across the ridge of a roof rests on it; across the common edge of a flat pair it passes.
    const auto roof = [](double height, double other) {
        return mesh_of({{0, 0, -1}, {0, 0, 1}, {1, height, 0}, {-1, other, 0}}, {{0, 1, 2}, {1, 0, 3}});
    };
    const TriangleMesh across = mesh_of({{-1, 0, 0}, {1, 0, 0}, {0, 3, 0}}, {{0, 1, 2}});
    EXPECT_EQ(Surfaces().add(roof(-1, -1)).add(across).count(), 0u);
    EXPECT_GT(Surfaces().add(roof(-1, 1)).add(across).count(), 0u);
}

TEST(SurfaceCrossings, CountsAreTheSameInAnyAttitude) {
    Random random(5);
    Surfaces first;
    first.add(scenes::ball(0.5, 7)).add(scenes::sheet(1.3, 9, true), {0.02, 0.11, -0.05});
    first.add(upright_tube(5), {0.3, 0.07, 0.2}, scenes::rotation({0, 0, 1}, 0.4));
    const auto expected = first.crossings();
    EXPECT_GT(expected.size(), 50u);
    for (int k = 0; k < 40; ++k) {
        const Mat3 turn = scenes::rotation(glm::normalize(random.in_cube(1.0)), random.uniform(0, 6));
        const Vec3 shift = random.in_cube(5.0);
        Surfaces moved = first;
        for (Vec3& v : moved.vertices) {
            v = turn * v + shift;
        }
        const auto found = moved.crossings();
        ASSERT_EQ(found.size(), expected.size()) << k;
        for (std::size_t c = 0; c < found.size(); ++c) {
            EXPECT_EQ(found[c].edge, expected[c].edge);
            EXPECT_EQ(found[c].triangle, expected[c].triangle);
            EXPECT_LT(glm::length(found[c].position - (turn * expected[c].position + shift)), 1e-12);
        }
    }
}

/// Six times the volume of a tetrahedron of integer corners up to 2^17, exactly.
std::int64_t exact_volume(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
    using Row = std::array<std::int64_t, 3>;
    const auto row = [&](const Vec3& x) {
        return Row{static_cast<std::int64_t>(x.x - a.x), static_cast<std::int64_t>(x.y - a.y),
                   static_cast<std::int64_t>(x.z - a.z)};
    };
    const Row u = row(b);
    const Row v = row(c);
    const Row w = row(d);
    return u[0] * (v[1] * w[2] - v[2] * w[1]) - u[1] * (v[0] * w[2] - v[2] * w[0]) + u[2] * (v[0] * w[1] - v[1] * w[0]);
}

using Crossings = std::set<std::tuple<std::uint32_t, std::uint32_t, std::uint32_t>>;  // edge and triangle

/// By exact arithmetic, over distinct edges and all triangles. Coordinates are integers.
Crossings by_brute_force(const TriangleMesh& mesh) {
    std::set<std::array<std::uint32_t, 2>> edges;
    for (const Triangle& t : mesh.triangles) {
        for (std::size_t k = 0; k < 3; ++k) {
            edges.insert({std::min(t[k], t[(k + 1) % 3]), std::max(t[k], t[(k + 1) % 3])});
        }
    }
    Crossings expected;
    const std::vector<Vec3>& x = mesh.vertices;
    for (const auto& [p, q] : edges) {
        for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
            const auto& [a, b, c] = mesh.triangles[t];
            const bool opposite =
                (exact_volume(x[a], x[b], x[c], x[p]) > 0) != (exact_volume(x[a], x[b], x[c], x[q]) > 0);
            const int around = (exact_volume(x[p], x[q], x[a], x[b]) > 0 ? 1 : 0) +
                               (exact_volume(x[p], x[q], x[b], x[c]) > 0 ? 1 : 0) +
                               (exact_volume(x[p], x[q], x[c], x[a]) > 0 ? 1 : 0);
            const std::set<std::uint32_t> corners{a, b, c, p, q};
            if (corners.size() == 5 && opposite && (around == 0 || around == 3)) {
                expected.insert({p, q, t});
            }
        }
    }
    return expected;
}

Crossings by_search(const TriangleMesh& mesh) {
    Crossings found;
    for (const SurfaceCrossing& c : Surfaces().add(mesh).crossings()) {
        EXPECT_TRUE(found.insert({c.edge[0], c.edge[1], c.triangle}).second) << "counted twice";
    }
    return found;
}

TEST(SurfaceCrossings, AgreeWithExactArithmeticAndBruteForceOnRandomSoups) {
    Random random(11);
    std::size_t crossings = 0;
    for (int round = 0; round < 60; ++round) {
        // Triangles of random size among random vertices, some of them shared.
        const double size = round % 3 == 0 ? 1e5 : round % 3 == 1 ? 2e4 : 3e3;
        TriangleMesh soup;
        for (std::uint32_t t = 0; t < 60; ++t) {
            const Vec3 at = random.in_cube(5e4);
            for (int k = 0; k < 3; ++k) {
                soup.vertices.push_back(glm::round(at + random.in_cube(0.5 * size)));
            }
            soup.triangles.push_back({3 * t, 3 * t + 1, 3 * t + (t % 4 == 0 && t > 0 ? 0 : 2)});
            if (t % 4 == 0 && t > 0) {
                soup.triangles.back()[2] = 3 * t - 1;
            }
        }
        const Crossings found = by_search(soup);
        ASSERT_EQ(found, by_brute_force(soup)) << round;
        crossings += found.size();
    }
    EXPECT_GT(crossings, 1000u);
}

TEST(SurfaceCrossings, AgreeWithExactArithmeticWhereFacesAroundAVertexFold) {
    // From a little uneven to crumpled, so that the faces around some vertices lie side by side and others do not.
    Random random(17);
    std::size_t crossings = 0;
    std::size_t clean = 0;
    for (int round = 0; round < 120; ++round) {
        TriangleMesh mesh = round % 2 == 0 ? scenes::sheet(1.0, 5, false) : scenes::ball(0.5, 5);
        const double amount = 0.02 * std::pow(1.5, round / 12);
        for (Vec3& v : mesh.vertices) {
            v = glm::round(1e5 * (v + random.in_cube(amount)));
        }
        // Triangles that look to either side.
        for (std::size_t t = static_cast<std::size_t>(round) % 3; t < mesh.triangles.size(); t += 3) {
            std::swap(mesh.triangles[t][0], mesh.triangles[t][1]);
        }
        const Crossings found = by_search(mesh);
        ASSERT_EQ(found, by_brute_force(mesh)) << round;
        crossings += found.size();
        clean += found.empty() ? 1U : 0U;
    }
    EXPECT_GT(crossings, 1000u);
    EXPECT_GT(clean, 20u);
}

TEST(SurfaceCrossings, OfAFanThatGoesAroundItsVertexTwiceAreFound) {
    // Ten faces of 72 degrees around one vertex, stairs that go up for one turn and down through themselves in the
    // next.
    TriangleMesh fan{{{0, 0, 0}}, {}};
    for (std::uint32_t k = 0; k < 10; ++k) {
        const double angle = k * glm::radians(72.0);
        const double height = 0.1 * std::min(k, 10 - k);
        const double radius = k < 5 ? 1.0 : 1.3;
        fan.vertices.push_back({radius * std::cos(angle), height, radius * std::sin(angle)});
        fan.triangles.push_back({0, 1 + k, 1 + (k + 1) % 10});
    }
    EXPECT_GT(Surfaces().add(fan).count(), 0u);
}

TEST(SurfaceCrossings, FollowsAStateFarFromThatOfItsTree) {
    // The tree was built for another state: only its speed may suffer.
    Random random(13);
    const TriangleMesh sheet = scenes::sheet(1.0, 6, true);
    const std::vector<CheckedSurface> surfaces{{sheet.triangles, 0}};
    SurfaceCrossings finder(surfaces, sheet.vertices);
    for (int k = 0; k < 20; ++k) {
        TriangleMesh crumpled = sheet;
        for (Vec3& v : crumpled.vertices) {
            v = random.in_cube(0.5);
        }
        const std::size_t found = finder.find(crumpled.vertices, rounding_of(crumpled.vertices)).size();
        EXPECT_EQ(found, Surfaces().add(crumpled).count());
        EXPECT_GT(found, 100u);
    }
    EXPECT_TRUE(finder.find(sheet.vertices, rounding_of(sheet.vertices)).empty());
}

TEST(SurfaceCrossings, OfASurfaceThatTumblesAndFoldsSlowlyAreThoseOfEachStateAlone) {
    // It rolls up onto itself and through itself while it flies.
    const TriangleMesh sheet = scenes::sheet(1.0, 12, true);
    const std::vector<CheckedSurface> surfaces{{sheet.triangles, 0}};
    for (const double pace : {1e-4, 1e-3, 1e-2}) {
        SurfaceCrossings finder(surfaces, sheet.vertices);
        std::size_t most = 0;
        for (int k = 0; k < 200; ++k) {
            const double roll = pace * k * 12.0;  // rad, over its length
            const Mat3 turn = scenes::rotation({0.6, 0.8, 0.0}, 0.02 * k);
            TriangleMesh state = sheet;
            for (Vec3& v : state.vertices) {
                const double angle = roll * (v.x + 0.5);
                const double radius = 1.0 / std::max(roll, 1e-9);
                v = turn * Vec3(radius * std::sin(angle), radius * (1.0 - std::cos(angle)) + 0.02 * v.z, v.z) +
                    Vec3(0.1 * k, 0, 0);
            }
            const auto found = finder.find(state.vertices, rounding_of(state.vertices));
            const auto expected = Surfaces().add(state).crossings();
            ASSERT_EQ(found.size(), expected.size()) << "pace " << pace << ", state " << k;
            for (std::size_t c = 0; c < found.size(); ++c) {
                EXPECT_EQ(found[c].edge, expected[c].edge);
                EXPECT_EQ(found[c].triangle, expected[c].triangle);
            }
            most = std::max(most, found.size());
        }
        EXPECT_EQ(most > 0, pace > 1e-3 * 2.0) << pace << ": " << most;
    }
}

TEST(SurfaceCrossings, AreNotSoughtForEverWhereManyFacesShareAVertex) {
    // All pairs of a fan's faces would be 5 times 10^9.
    TriangleMesh fan{{{0, 0, 0}}, {}};
    for (std::uint32_t k = 0; k < 100'000; ++k) {
        fan.vertices.push_back({std::cos(6e-5 * k), 0.1 * std::sin(k), std::sin(6e-5 * k)});
        if (k > 0) {
            fan.triangles.push_back({0, k, k + 1});
        }
    }
    const std::vector<CheckedSurface> surfaces{{fan.triangles, 0}};
    SurfaceCrossings finder(surfaces, fan.vertices);
    (void)finder.find(fan.vertices, rounding_of(fan.vertices), 1'000'000);
    EXPECT_FALSE(finder.complete());
}

TEST(SurfaceCrossings, OfAStateThatIsNotFiniteAreNotComplete) {
    const TriangleMesh ball = scenes::ball(0.5, 5);
    const std::vector<CheckedSurface> surfaces{{ball.triangles, 0}};
    SurfaceCrossings finder(surfaces, ball.vertices);
    for (const double bad : {std::nan(""), HUGE_VAL}) {
        for (int axis = 0; axis < 3; ++axis) {
            std::vector<Vec3> vertices = ball.vertices;
            vertices[7][axis] = bad;
            EXPECT_TRUE(finder.find(vertices, 1e-12).empty());
            EXPECT_FALSE(finder.complete());
        }
    }
    (void)finder.find(ball.vertices, 1e-12);
    EXPECT_TRUE(finder.complete());
    EXPECT_EQ(find_ground_crossings(std::vector{Vec3(0.0, std::nan(""), 0.0)}, 0.0, 1e-12).vertices, 1u);
}

TEST(SurfaceCrossings, VerticesBelowTheGroundAreCountedWithTheirDepth) {
    const std::vector<Vec3> vertices{
        {0, 0.1, 0}, {0, 0.05, 1}, {5, 0.049999999999999996, 1}, {3, 0.01, 0}, {4, 0.03, 0}};
    const auto found = find_ground_crossings(vertices, 0.05, rounding_of(vertices));
    EXPECT_EQ(found.vertices, 2u);
    EXPECT_NEAR(found.depth, 0.04, 1e-15);
    EXPECT_EQ(find_ground_crossings(vertices, 0.0, rounding_of(vertices)).vertices, 0u);
}

}  // namespace
