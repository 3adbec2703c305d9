#include "haptic/sim/mesh_check.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <limits>
#include <map>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "haptic/sim/cloth.hpp"
#include "haptic/sim/fan.hpp"
#include "haptic/sim/fish.hpp"

namespace haptic::sim {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

struct Soup {
    std::vector<Vec3> vertices;
    std::vector<Triangle> triangles;
};

CheckedMesh check(const Soup& soup, const MeshCheckSettings& settings = {}) {
    return check_mesh(soup.vertices, soup.triangles, settings, "test");
}

std::string refusal(const Soup& soup, const MeshCheckSettings& settings = {}) {
    try {
        (void)check(soup, settings);
    } catch (const MeshError& error) {
        return error.what();
    }
    return "not refused";
}

/// A unit cube with a corner at the origin, oriented outward.
Soup cube(const Vec3& at = Vec3(0.0)) {
    Soup soup;
    for (unsigned i = 0; i < 8; ++i) {
        soup.vertices.push_back(at + Vec3(i & 1U, (i >> 1U) & 1U, (i >> 2U) & 1U));
    }
    soup.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                      {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
    return soup;
}

void append(Soup& soup, const Soup& other) {
    const auto first = static_cast<std::uint32_t>(soup.vertices.size());
    soup.vertices.insert(soup.vertices.end(), other.vertices.begin(), other.vertices.end());
    for (const auto& [a, b, c] : other.triangles) {
        soup.triangles.push_back({a + first, b + first, c + first});
    }
}

/// Separate vertices for each triangle, as in an STL file.
Soup split(const Soup& soup) {
    Soup parts;
    for (const Triangle& triangle : soup.triangles) {
        for (const std::uint32_t i : triangle) {
            parts.vertices.push_back(soup.vertices[i]);
        }
        const auto n = static_cast<std::uint32_t>(parts.vertices.size());
        parts.triangles.push_back({n - 3, n - 2, n - 1});
    }
    return parts;
}

TEST(MeshCheck, HasNoWarningsForACube) {
    const Soup given = cube({5.0, -3.0, 1.0});
    const auto [mesh, report] = check(given);
    EXPECT_EQ(mesh.vertices, given.vertices);
    EXPECT_EQ(mesh.triangles, given.triangles);
    EXPECT_TRUE(mesh.closed);
    EXPECT_TRUE(report.closed);
    EXPECT_TRUE(report.orientable);
    EXPECT_FALSE(report.turned);
    EXPECT_EQ(report.components, 1u);
    EXPECT_EQ(report.low, Vec3(5.0, -3.0, 1.0));
    EXPECT_EQ(report.high, Vec3(6.0, -2.0, 2.0));
    EXPECT_NEAR(report.area, 6.0, 1e-14);
    EXPECT_NEAR(report.volume, 1.0, 1e-14);
    EXPECT_THAT(report.warnings, IsEmpty());
}

TEST(MeshCheck, MergesVerticesThatWereSplitAtSeams) {
    const Soup given = split(cube());
    const auto [mesh, report] = check(given);
    EXPECT_EQ(report.vertices_given, 36u);
    EXPECT_EQ(report.vertices, 8u);
    EXPECT_EQ(report.welded, 28u);
    EXPECT_TRUE(mesh.closed);
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        for (std::size_t i = 0; i < 3; ++i) {
            EXPECT_EQ(mesh.vertices[mesh.triangles[t][i]], given.vertices[given.triangles[t][i]]);
        }
    }
}

TEST(MeshCheck, WeldsWithinTheToleranceAndNotBeyond) {
    Soup given = split(cube());
    // Tolerance: 1e-3 of the diagonal, 1.7e-3 m.
    for (std::size_t i = 0; i < given.vertices.size(); ++i) {
        given.vertices[i].x += i % 2 == 0 ? 4e-4 : -4e-4;
    }
    EXPECT_EQ(check(given, {.weld_tolerance = 1e-3}).report.vertices, 8u);
    EXPECT_FALSE(check(given, {.weld_tolerance = 1e-4}).mesh.closed);
    EXPECT_EQ(check(split(cube()), {.weld_tolerance = 0.0}).report.vertices, 8u);
}

TEST(Weld, MatchesBruteForce) {
    std::mt19937 random(7);
    for (const double tolerance : {0.0, 1e-3, 0.02, 0.3}) {
        std::vector<Vec3> points;
        for (int i = 0; i < 600; ++i) {
            const auto coordinate = [&] { return static_cast<double>(random() % 2048) / 1024.0 - 1.0; };
            const double x = coordinate();
            const double y = coordinate();
            points.emplace_back(x, y, coordinate());
            if (i % 3 == 0) {
                points.push_back(points[random() % points.size()] + Vec3(0.5 * tolerance, 0.0, 0.0));
            }
        }
        std::vector<std::uint32_t> expected(points.size());
        std::vector<std::uint32_t> kept;
        for (std::uint32_t i = 0; i < points.size(); ++i) {
            const auto near = std::find_if(kept.begin(), kept.end(), [&](std::uint32_t j) {
                return glm::dot(points[i] - points[j], points[i] - points[j]) <= tolerance * tolerance;
            });
            expected[i] = near == kept.end() ? i : *near;
            if (near == kept.end()) {
                kept.push_back(i);
            }
        }
        EXPECT_LT(kept.size(), points.size());
        EXPECT_EQ(weld(points, tolerance), expected) << tolerance;
    }
}

TEST(Weld, HandlesSignedZeroAndDistantCoordinates) {
    const std::vector<Vec3> points{{0.0, 0.0, 0.0}, {-0.0, 0.0, -0.0}, {1e6, 0.0, 0.0}, {1e6, 0.0, 1e-9}, {1e-9, 0, 0}};
    EXPECT_THAT(weld(points, 0.0), ElementsAre(0, 0, 2, 3, 4));
    EXPECT_THAT(weld(points, 1e-8), ElementsAre(0, 0, 2, 2, 0));
}

TEST(MeshCheck, NamesTheVertexThatIsNotFinite) {
    Soup given = cube();
    given.vertices[5].y = std::numeric_limits<double>::quiet_NaN();
    EXPECT_THAT(refusal(given), AllOf(StartsWith("test: "), HasSubstr("vertex 5")));
    given.vertices[5].y = -std::numeric_limits<double>::infinity();
    EXPECT_THAT(refusal(given), HasSubstr("vertex 5"));
    given.vertices[5].y = 2e6;
    EXPECT_THAT(refusal(given), AllOf(HasSubstr("vertex 5"), HasSubstr("scale")));
}

TEST(MeshCheck, NamesTheTriangleWithABadIndex) {
    Soup given = cube();
    given.triangles[7] = {2, 8, 3};
    EXPECT_THAT(refusal(given), HasSubstr("triangle 7 (vertices 2, 8, 3)"));
}

TEST(MeshCheck, RefusesTooManyElementsOrNone) {
    EXPECT_THAT(refusal(cube(), {.max_triangles = 11}), HasSubstr("12 triangles, more than the 11"));
    EXPECT_THAT(refusal(cube(), {.max_vertices = 7}), HasSubstr("8 vertices, more than the 7"));
    EXPECT_EQ(refusal(cube(), {.max_vertices = 8, .max_triangles = 12}), "not refused");
    EXPECT_THAT(refusal({cube().vertices, {}}), HasSubstr("no triangles"));
    EXPECT_THAT(refusal({{{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}, {{0, 1, 2}}}), HasSubstr("triangle 0 (vertices 0, 1, 2)"));
    EXPECT_THAT(refusal({{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {{0, 1, 2}}}), HasSubstr("triangle 0 (vertices 0, 1, 2)"));
    EXPECT_THROW((void)check(cube(), {.weld_tolerance = 0.1}), std::invalid_argument);
    EXPECT_THROW((void)check(cube(), {.weld_tolerance = -1e-9}), std::invalid_argument);
    EXPECT_THROW((void)check(cube(), {.max_triangles = 0}), std::invalid_argument);
}

TEST(MeshCheck, RemovesTrianglesThatCollapse) {
    Soup given = cube();
    given.triangles.insert(given.triangles.begin() + 3, {6, 6, 7});
    const auto [mesh, report] = check(given);
    EXPECT_EQ(report.collapsed, 1u);
    EXPECT_EQ(mesh.triangles, cube().triangles);
    EXPECT_THAT(report.warnings, ElementsAre(HasSubstr("triangle 3 (vertices 6, 6, 7)")));
}

TEST(MeshCheck, RemovesDuplicateTriangles) {
    Soup given = cube();
    given.triangles.push_back({7, 4, 5});  // as {4, 5, 7}
    const auto [mesh, report] = check(given);
    EXPECT_EQ(report.duplicates, 1u);
    EXPECT_EQ(report.double_faced, 0u);
    EXPECT_EQ(mesh.triangles, cube().triangles);
    EXPECT_TRUE(mesh.closed);
    EXPECT_THAT(report.warnings, ElementsAre(HasSubstr("triangle 12 (vertices 7, 4, 5)")));
}

TEST(MeshCheck, RemovesUnusedVertices) {
    Soup given = cube();
    given.vertices.insert(given.vertices.begin(), Vec3(100.0, 0.0, 0.0));
    for (Triangle& triangle : given.triangles) {
        for (std::uint32_t& i : triangle) {
            ++i;
        }
    }
    const auto [mesh, report] = check(given);
    EXPECT_EQ(report.unused, 1u);
    EXPECT_EQ(mesh.vertices, cube().vertices);
    EXPECT_EQ(mesh.triangles, cube().triangles);
    EXPECT_EQ(report.high, Vec3(1.0));
}

TEST(MeshCheck, KeepsDegenerateTrianglesThatConnectTheirNeighbours) {
    // A tetrahedron with a vertex in the middle of one edge; a degenerate triangle closes the gap to the opposite face.
    const Soup given{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.5, 0, 0}},
                     {{0, 2, 1}, {0, 4, 3}, {4, 1, 3}, {0, 1, 4}, {0, 3, 2}, {1, 2, 3}}};
    const auto [mesh, report] = check(given);
    EXPECT_EQ(report.degenerate, 1u);
    EXPECT_EQ(mesh.triangles.size(), 6u);
    EXPECT_TRUE(mesh.closed);
    EXPECT_NEAR(report.volume, 1.0 / 6.0, 1e-15);
    EXPECT_THAT(report.warnings, ElementsAre(HasSubstr("triangle 3 (vertices 0, 1, 4)")));
}

TEST(MeshCheck, TreatsAMeshWithAHoleAsOpen) {
    Soup given = cube();
    given.triangles.erase(given.triangles.begin() + 4);
    const auto [mesh, report] = check(given);
    EXPECT_FALSE(mesh.closed);
    EXPECT_EQ(report.boundary_edges, 3u);
    EXPECT_EQ(report.volume, 0.0);
    EXPECT_THAT(report.warnings, ElementsAre(HasSubstr("3 edges have one triangle only")));
}

TEST(MeshCheck, ReversesAnInsideOutMesh) {
    Soup given = cube();
    for (Triangle& triangle : given.triangles) {
        std::swap(triangle[1], triangle[2]);
    }
    const auto [mesh, report] = check(given);
    EXPECT_TRUE(report.turned);
    EXPECT_EQ(report.flipped, 0u);
    EXPECT_EQ(mesh.triangles, cube().triangles);
    EXPECT_THAT(report.warnings, ElementsAre(HasSubstr("inside out")));
}

TEST(MeshCheck, ReversesTheMinorityThatDisagrees) {
    Soup given = cube();
    std::swap(given.triangles[2][1], given.triangles[2][2]);
    std::swap(given.triangles[9][1], given.triangles[9][2]);
    const auto [mesh, report] = check(given);
    EXPECT_EQ(report.flipped, 2u);
    EXPECT_FALSE(report.turned);
    EXPECT_EQ(mesh.triangles, cube().triangles);
    EXPECT_THAT(report.warnings, ElementsAre(HasSubstr("triangle 2 (vertices 4, 7, 5)")));
}

TEST(MeshCheck, FindsThatAMoebiusStripIsNotOrientable) {
    Soup given;
    constexpr std::uint32_t kSteps = 12;
    for (std::uint32_t i = 0; i < kSteps; ++i) {
        const double angle = 2.0 * 3.14159265358979 * i / kSteps;
        const Vec3 middle(std::cos(angle), std::sin(angle), 0.0);
        const Vec3 across = 0.3 * (std::cos(0.5 * angle) * middle + Vec3(0.0, 0.0, std::sin(0.5 * angle)));
        given.vertices.push_back(middle - across);
        given.vertices.push_back(middle + across);
    }
    for (std::uint32_t i = 0; i < kSteps; ++i) {
        const std::uint32_t a = 2 * i;
        const std::uint32_t b = a + 1;
        const std::uint32_t c = i + 1 < kSteps ? a + 2 : 1;
        const std::uint32_t d = i + 1 < kSteps ? a + 3 : 0;
        given.triangles.push_back({a, b, c});
        given.triangles.push_back({b, d, c});
    }
    const auto [mesh, report] = check(given);
    EXPECT_FALSE(report.orientable);
    EXPECT_FALSE(mesh.closed);
    EXPECT_EQ(report.boundary_edges, 2 * kSteps);
    EXPECT_EQ(mesh.triangles, given.triangles);
    EXPECT_THAT(report.warnings, Contains(HasSubstr("one side only")));
}

TEST(MeshCheck, RecognisesADoubleFacedSheet) {
    const TriangleMesh cloth = make_cloth_mesh({.vertices_per_side = 5});
    const auto [mesh, report] = check({cloth.vertices, cloth.triangles});
    EXPECT_EQ(report.double_faced, 32u);
    EXPECT_EQ(report.boundary_edges, 16u);
    EXPECT_EQ(report.crowded_edges, 0u);
    EXPECT_EQ(report.pinched_vertices, 0u);
    EXPECT_FALSE(mesh.closed);
    EXPECT_NEAR(report.area, 2.0, 1e-14);
    EXPECT_EQ(mesh.triangles, cloth.triangles);
    EXPECT_THAT(report.warnings, IsEmpty());
}

TEST(MeshCheck, NamesWhereThreeTrianglesShareAnEdge) {
    const Soup given{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, -1, 0}}, {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}}};
    const auto [mesh, report] = check(given);
    EXPECT_EQ(report.crowded_edges, 1u);
    EXPECT_EQ(report.boundary_edges, 6u);
    EXPECT_EQ(report.pinched_vertices, 0u);
    EXPECT_EQ(mesh.triangles.size(), 3u);
    EXPECT_THAT(report.warnings, Contains(HasSubstr("triangle 2 (vertices 0, 1, 4)")));
}

TEST(MeshCheck, FindsPartsThatTouchInOneVertex) {
    Soup given = cube();
    append(given, cube({1.0, 1.0, 1.0}));
    const auto [mesh, report] = check(given);
    EXPECT_EQ(report.vertices, 15u);
    EXPECT_EQ(report.pinched_vertices, 1u);
    EXPECT_EQ(report.components, 1u);
    EXPECT_TRUE(mesh.closed);
    EXPECT_NEAR(report.volume, 2.0, 1e-14);
    EXPECT_THAT(report.warnings, ElementsAre(HasSubstr("(1.0")));
}

TEST(MeshCheck, CountsParts) {
    Soup given = cube();
    append(given, cube({3.0, 0.0, 0.0}));
    append(given, cube({0.0, 3.0, 0.0}));
    const auto [mesh, report] = check(given);
    EXPECT_EQ(report.components, 3u);
    EXPECT_TRUE(mesh.closed);
    EXPECT_NEAR(report.volume, 3.0, 1e-14);
}

TEST(MeshCheck, CountsACavityAsSuch) {
    Soup given = cube();
    Soup inner = cube();
    for (Vec3& v : inner.vertices) {
        v = 0.25 + 0.5 * v;
    }
    for (Triangle& triangle : inner.triangles) {
        std::swap(triangle[1], triangle[2]);
    }
    append(given, inner);
    const auto [mesh, report] = check(given);
    EXPECT_TRUE(mesh.closed);
    EXPECT_FALSE(report.turned);
    EXPECT_NEAR(report.volume, 1.0 - 0.125, 1e-14);
}

TEST(MeshCheck, AcceptsGeneratedMeshes) {
    const TriangleMesh fish = make_fish_mesh({});
    const auto [mesh, report] = check({fish.vertices, fish.triangles});
    EXPECT_THAT(report.warnings, IsEmpty());
    EXPECT_EQ(mesh.vertices, fish.vertices);
    EXPECT_EQ(mesh.triangles, fish.triangles);
    EXPECT_TRUE(mesh.closed);
    const TriangleMesh fan = make_fan_mesh({});
    const CheckedMesh checked = check({fan.vertices, fan.triangles});
    EXPECT_EQ(checked.mesh.triangles, fan.triangles);
    EXPECT_EQ(checked.report.boundary_edges, 32u);
}

/// Counts edges with a map.
struct CountedEdges {
    std::size_t boundary = 0;
    std::size_t crowded = 0;
};

CountedEdges count_edges(const std::vector<Triangle>& triangles) {
    std::map<std::set<std::uint32_t>, int> edges;
    std::set<std::set<std::uint32_t>> seen;
    for (const Triangle& t : triangles) {
        if (seen.insert({t[0], t[1], t[2]}).second) {  // one of a pair
            for (std::size_t i = 0; i < 3; ++i) {
                ++edges[{t[i], t[(i + 1) % 3]}];
            }
        }
    }
    CountedEdges counted;
    for (const auto& [edge, count] : edges) {
        counted.boundary += count == 1 ? 1 : 0;
        counted.crowded += count > 2 ? 1 : 0;
    }
    return counted;
}

TEST(MeshCheck, CountsEdgesOfRandomTrianglesLikeAMapAndIsIdempotent) {
    std::mt19937 random(3);
    for (int round = 0; round < 200; ++round) {
        Soup given;
        for (int i = 0; i < 12; ++i) {
            const auto coordinate = [&] { return static_cast<double>(random() % 3); };
            const double x = coordinate();
            const double y = coordinate();
            given.vertices.emplace_back(x, y, coordinate());
        }
        for (int i = 0; i < 14; ++i) {
            const auto index = [&] { return static_cast<std::uint32_t>(random() % 12); };
            const std::uint32_t a = index();
            const std::uint32_t b = index();
            given.triangles.push_back({a, b, index()});
        }
        if (refusal(given) != "not refused") {
            continue;
        }
        const auto [mesh, report] = check(given);
        const CountedEdges expected = count_edges(mesh.triangles);
        EXPECT_EQ(report.boundary_edges, expected.boundary);
        EXPECT_EQ(report.crowded_edges, expected.crowded);
        EXPECT_EQ(report.triangles_given, report.triangles + report.collapsed + report.duplicates);
        EXPECT_EQ(report.vertices_given, report.vertices + report.welded + report.unused);
        const auto [again, second] = check({mesh.vertices, mesh.triangles});
        EXPECT_EQ(again.vertices, mesh.vertices);
        EXPECT_EQ(again.triangles, mesh.triangles);
        EXPECT_EQ(again.closed, mesh.closed);
        EXPECT_EQ(second.flipped + second.welded + second.collapsed + second.duplicates + second.unused, 0u);
    }
}

}  // namespace
}  // namespace haptic::sim
