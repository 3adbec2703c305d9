#include "haptic/sim/fish.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <limits>
#include <map>
#include <numbers>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

namespace haptic::sim {
namespace {

using Edge = std::pair<std::uint32_t, std::uint32_t>;

/// Occurrences of each directed edge.
std::map<Edge, int> edges_of(const TriangleMesh& mesh) {
    std::map<Edge, int> edges;
    for (const Triangle& t : mesh.triangles) {
        for (std::size_t i = 0; i < 3; ++i) {
            ++edges[{t[i], t[(i + 1) % 3]}];
        }
    }
    return edges;
}

/// By the divergence theorem; positive if faces are oriented outward.
double volume_of(const TriangleMesh& mesh) {
    double six_volumes = 0.0;
    for (const auto& [a, b, c] : mesh.triangles) {
        six_volumes += glm::dot(mesh.vertices[a], glm::cross(mesh.vertices[b], mesh.vertices[c]));
    }
    return six_volumes / 6.0;
}

double area_of(const TriangleMesh& mesh, const Triangle& t) {
    return 0.5 * glm::length(
                     glm::cross(mesh.vertices[t[1]] - mesh.vertices[t[0]], mesh.vertices[t[2]] - mesh.vertices[t[0]]));
}

void expect_closed_and_consistent(const TriangleMesh& mesh) {
    const std::map<Edge, int> edges = edges_of(mesh);
    for (const auto& [edge, count] : edges) {
        EXPECT_EQ(count, 1) << "edge " << edge.first << " - " << edge.second;
        EXPECT_TRUE(edges.contains({edge.second, edge.first})) << "edge " << edge.first << " - " << edge.second;
    }
    EXPECT_TRUE(mesh.closed);
}

/// Whether the segment crosses the interior of the triangle, by the signs of five volumes.
bool crosses(const Vec3& p, const Vec3& q, const Vec3& a, const Vec3& b, const Vec3& c) {
    const auto volume = [](const Vec3& o, const Vec3& u, const Vec3& v, const Vec3& w) {
        return glm::dot(u - o, glm::cross(v - o, w - o));
    };
    if ((volume(a, b, c, p) > 0.0) == (volume(a, b, c, q) > 0.0)) {
        return false;
    }
    const bool first = volume(p, q, a, b) > 0.0;
    return first == (volume(p, q, b, c) > 0.0) && first == (volume(p, q, c, a) > 0.0);
}

TEST(Fish, HasTheTrianglesOfTheThesisAndNoSeam) {
    const TriangleMesh mesh = make_fish_mesh({});
    EXPECT_EQ(mesh.triangles.size(), 1700u);
    EXPECT_EQ(mesh.vertices.size(), 852u);  // Euler: V - 3/2 T + T = 2
    const auto before = [](const Vec3& a, const Vec3& b) {
        return std::array{a.x, a.y, a.z} < std::array{b.x, b.y, b.z};
    };
    EXPECT_EQ(std::set(mesh.vertices.begin(), mesh.vertices.end(), before).size(), 852u);
}

TEST(Fish, IsClosedAndOrientedOutward) {
    const TriangleMesh mesh = make_fish_mesh({});
    expect_closed_and_consistent(mesh);
    // The volume is between that of the ellipsoid with the body's half axes (0.41, 0.13 and 0.071 lengths) and that of
    // two cones.
    const double ellipsoid = 4.0 / 3.0 * std::numbers::pi * 0.41 * 0.13 * 0.071 * 0.3 * 0.3 * 0.3;
    EXPECT_GT(volume_of(mesh), 0.5 * ellipsoid);
    EXPECT_LT(volume_of(mesh), ellipsoid);
}

TEST(Fish, HasNoTriangleWithoutArea) {
    const TriangleMesh mesh = make_fish_mesh({});
    double smallest = std::numeric_limits<double>::infinity();
    for (const Triangle& t : mesh.triangles) {
        smallest = std::min(smallest, area_of(mesh, t));
    }
    EXPECT_GT(smallest, 5e-7);  // m^2; the mean is 6e-5
}

TEST(Fish, DoesNotIntersectItself) {
    const TriangleMesh mesh = make_fish_mesh({});
    std::vector<std::pair<Vec3, Vec3>> boxes;
    for (const auto& [a, b, c] : mesh.triangles) {
        const Vec3 &p = mesh.vertices[a], &q = mesh.vertices[b], &r = mesh.vertices[c];
        boxes.emplace_back(glm::min(p, glm::min(q, r)), glm::max(p, glm::max(q, r)));
    }
    std::size_t tried = 0;
    for (const auto& [edge, count] : edges_of(mesh)) {
        const Vec3& p = mesh.vertices[edge.first];
        const Vec3& q = mesh.vertices[edge.second];
        const Vec3 low = glm::min(p, q);
        const Vec3 high = glm::max(p, q);
        for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
            const auto& [a, b, c] = mesh.triangles[t];
            const bool neighbours = a == edge.first || b == edge.first || c == edge.first || a == edge.second ||
                                    b == edge.second || c == edge.second;
            if (neighbours || glm::any(glm::greaterThan(low, boxes[t].second)) ||
                glm::any(glm::greaterThan(boxes[t].first, high))) {
                continue;
            }
            ++tried;
            EXPECT_FALSE(crosses(p, q, mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]))
                << "edge " << edge.first << " - " << edge.second << ", triangle " << t;
        }
    }
    EXPECT_GT(tried, 1000u);
}

TEST(Fish, IsItsOwnMirrorImage) {
    const TriangleMesh mesh = make_fish_mesh({});
    std::map<std::array<double, 3>, std::uint32_t> at;
    for (std::uint32_t i = 0; i < mesh.vertices.size(); ++i) {
        at[{mesh.vertices[i].x, mesh.vertices[i].y, mesh.vertices[i].z}] = i;
    }
    const auto turned = [](Triangle t) {
        std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
        return t;
    };
    std::set<Triangle> all;
    for (const Triangle& t : mesh.triangles) {
        all.insert(turned(t));
    }
    for (const Triangle& t : mesh.triangles) {
        Triangle image{};
        for (std::size_t i = 0; i < 3; ++i) {
            const Vec3& v = mesh.vertices[t[i]];
            const auto found = at.find({v.x, v.y, -v.z});
            ASSERT_NE(found, at.end()) << "vertex " << t[i];
            image[2 - i] = found->second;
        }
        EXPECT_TRUE(all.contains(turned(image))) << "triangle " << t[0] << ", " << t[1] << ", " << t[2];
    }
}

TEST(Fish, LooksAlongXWithItsBackUp) {
    const TriangleMesh mesh = make_fish_mesh({.length = 2.0, .centre = {1.0, 0.0, 0.0}});
    Vec3 low(std::numeric_limits<double>::infinity());
    Vec3 high = -low;
    double widest = 0.0;
    double widest_at = 0.0;
    for (const Vec3& v : mesh.vertices) {
        low = glm::min(low, v);
        high = glm::max(high, v);
        if (v.z > widest && v.y > 0.0) {
            widest = v.z;
            widest_at = v.x;
        }
    }
    EXPECT_DOUBLE_EQ(low.x, 0.0);
    EXPECT_DOUBLE_EQ(high.x, 2.0);
    EXPECT_DOUBLE_EQ(low.z, -high.z);
    EXPECT_GT(widest_at, 1.0);  // the thickest part is in the front half
    EXPECT_GT(high.y, -low.y);  // the dorsal fin
    EXPECT_NEAR(high.y - low.y, 0.4 * 2.0, 0.1);
}

TEST(Fish, TurnsWithItsOrientation) {
    const TriangleMesh mesh = make_fish_mesh({});
    const TriangleMesh turned = make_fish_mesh({.centre = {1.0, 2.0, 3.0}, .orientation = {0.0, 0.0, 1.0, 0.0}});
    ASSERT_EQ(mesh.triangles, turned.triangles);
    for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
        const Vec3 expected(1.0 - mesh.vertices[i].x, 2.0 + mesh.vertices[i].y, 3.0 - mesh.vertices[i].z);
        EXPECT_NEAR(glm::length(turned.vertices[i] - expected), 0.0, 1e-15);
    }
}

TEST(Fish, KeepsItsShapeWhenRefined) {
    const TriangleMesh coarse = make_fish_mesh({});
    const TriangleMesh fine = make_fish_mesh({.refinements = 2});
    EXPECT_EQ(fine.triangles.size(), 16u * 1700u);
    EXPECT_EQ(fine.vertices.size(), 2u + 8u * 1700u);
    expect_closed_and_consistent(fine);
    EXPECT_NEAR(volume_of(fine), volume_of(coarse), 1e-16);
}

TEST(Fish, RefusesInvalidShapes) {
    EXPECT_THROW((void)make_fish_mesh({.length = 0.0}), std::invalid_argument);
    EXPECT_THROW((void)make_fish_mesh({.length = std::numeric_limits<double>::infinity()}), std::invalid_argument);
    EXPECT_THROW((void)make_fish_mesh({.refinements = 6}), std::invalid_argument);
}

}  // namespace
}  // namespace haptic::sim
