#include "haptic/sim/organ.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <limits>
#include <map>
#include <stdexcept>
#include <utility>
#include <vector>

#include "haptic/sim/mesh_check.hpp"

namespace haptic::sim {
namespace {

using OrganSide = std::pair<std::uint32_t, std::uint32_t>;

/// Triangles by their directed edges.
std::map<OrganSide, std::vector<std::size_t>> organ_sides(const TriangleMesh& mesh) {
    std::map<OrganSide, std::vector<std::size_t>> sides;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        for (std::size_t i = 0; i < 3; ++i) {
            sides[{mesh.triangles[t][i], mesh.triangles[t][(i + 1) % 3]}].push_back(t);
        }
    }
    return sides;
}

Vec3 organ_normal(const TriangleMesh& mesh, std::size_t t) {
    const auto& [a, b, c] = mesh.triangles[t];
    return glm::normalize(glm::cross(mesh.vertices[b] - mesh.vertices[a], mesh.vertices[c] - mesh.vertices[a]));
}

MeshReport organ_report(const TriangleMesh& mesh) {
    return check_mesh(mesh.vertices, mesh.triangles, {}, "organ").report;
}

/// Heights at which the vertical line through (x, z) crosses the surface, in ascending order.
std::vector<double> organ_heights(const TriangleMesh& mesh, double x, double z) {
    std::vector<double> heights;
    for (const auto& [i, j, k] : mesh.triangles) {
        const Vec3 &a = mesh.vertices[i], &b = mesh.vertices[j], &c = mesh.vertices[k];
        const auto area = [](double px, double pz, double qx, double qz) { return px * qz - pz * qx; };
        const double u = area(b.x - x, b.z - z, c.x - x, c.z - z);
        const double v = area(c.x - x, c.z - z, a.x - x, a.z - z);
        const double w = area(a.x - x, a.z - z, b.x - x, b.z - z);
        if ((u > 0.0 && v > 0.0 && w > 0.0) || (u < 0.0 && v < 0.0 && w < 0.0)) {
            heights.push_back((u * a.y + v * b.y + w * c.y) / (u + v + w));
        }
    }
    std::sort(heights.begin(), heights.end());
    return heights;
}

/// Whether the segment crosses the interior of the triangle, by the signs of five volumes.
bool organ_crosses(const Vec3& p, const Vec3& q, const Vec3& a, const Vec3& b, const Vec3& c) {
    const auto volume = [](const Vec3& o, const Vec3& u, const Vec3& v, const Vec3& w) {
        return glm::dot(u - o, glm::cross(v - o, w - o));
    };
    if ((volume(a, b, c, p) > 0.0) == (volume(a, b, c, q) > 0.0)) {
        return false;
    }
    const bool first = volume(p, q, a, b) > 0.0;
    return first == (volume(p, q, b, c) > 0.0) && first == (volume(p, q, c, a) > 0.0);
}

TEST(Organ, IsClosedAndOrientedOutward) {
    for (const std::uint32_t refinements : {0u, 1u, 2u}) {
        const OrganShape shape{.refinements = refinements};
        const TriangleMesh mesh = make_organ_mesh(shape);
        EXPECT_EQ(mesh.triangles.size(), std::size_t{1620} << (2 * refinements));
        EXPECT_EQ(mesh.triangles.size(), organ_triangles(shape));
        EXPECT_EQ(mesh.vertices.size(), mesh.triangles.size() / 2 + 2);  // Euler
        EXPECT_TRUE(mesh.closed);
        const auto sides = organ_sides(mesh);
        for (const auto& [side, triangles] : sides) {
            EXPECT_EQ(triangles.size(), 1u) << side.first << " - " << side.second;
            EXPECT_TRUE(sides.contains({side.second, side.first})) << side.first << " - " << side.second;
        }
        const MeshReport report = organ_report(mesh);
        EXPECT_TRUE(report.warnings.empty());
        EXPECT_TRUE(report.closed && !report.turned);
        EXPECT_EQ(report.welded + report.unused + report.collapsed + report.flipped + report.degenerate, 0u);
        EXPECT_EQ(report.components, 1u);
    }
}

TEST(Organ, DoesNotIntersectItself) {
    const TriangleMesh mesh = make_organ_mesh({});
    std::vector<std::pair<Vec3, Vec3>> boxes;
    for (const auto& [a, b, c] : mesh.triangles) {
        const Vec3 &p = mesh.vertices[a], &q = mesh.vertices[b], &r = mesh.vertices[c];
        boxes.emplace_back(glm::min(p, glm::min(q, r)), glm::max(p, glm::max(q, r)));
    }
    std::size_t tried = 0;
    for (const auto& [side, triangles] : organ_sides(mesh)) {
        const Vec3& p = mesh.vertices[side.first];
        const Vec3& q = mesh.vertices[side.second];
        const Vec3 low = glm::min(p, q);
        const Vec3 high = glm::max(p, q);
        for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
            const Triangle& corners = mesh.triangles[t];
            const bool neighbours = std::any_of(corners.begin(), corners.end(),
                                                [&](std::uint32_t i) { return i == side.first || i == side.second; });
            if (neighbours || glm::any(glm::greaterThan(low, boxes[t].second)) ||
                glm::any(glm::greaterThan(boxes[t].first, high))) {
                continue;
            }
            ++tried;
            EXPECT_FALSE(
                organ_crosses(p, q, mesh.vertices[corners[0]], mesh.vertices[corners[1]], mesh.vertices[corners[2]]))
                << "edge " << side.first << " - " << side.second << ", triangle " << t;
        }
    }
    EXPECT_GT(tried, 500u);
}

TEST(Organ, HasTheProportionsOfALiver) {
    const TriangleMesh mesh = make_organ_mesh({});
    const MeshReport report = organ_report(mesh);
    EXPECT_DOUBLE_EQ(report.low.x, -0.1);
    EXPECT_DOUBLE_EQ(report.high.x, 0.1);
    const Vec3 size = report.high - report.low;
    EXPECT_NEAR(size.y, 0.073, 0.002);
    EXPECT_NEAR(size.z, 0.133, 0.002);
    EXPECT_LT(glm::length(report.high + report.low), 0.002);  // centred
    EXPECT_NEAR(report.volume, 0.66e-3, 0.02e-3);             // m^3

    // The lobe at -x is thick, that at +x thin; the dome's underside is hollow.
    const auto thickness = [&](double x, double z) {
        const std::vector<double> heights = organ_heights(mesh, x, z);
        return heights.size() == 2 ? heights[1] - heights[0] : 0.0;
    };
    EXPECT_GT(thickness(-0.04123, 0.00117), 0.045);
    EXPECT_LT(thickness(0.07123, -0.01117), 0.020);
    EXPECT_GT(thickness(0.07123, -0.01117), 0.005);
    const double middle = organ_heights(mesh, -0.03123, 0.01117).front();
    EXPECT_GT(middle, organ_heights(mesh, -0.03123, 0.06017).front() + 0.003);
    EXPECT_GT(middle, organ_heights(mesh, -0.03123, -0.05017).front() + 0.003);
}

TEST(Organ, HasNoNeedlesAndIsSmooth) {
    const TriangleMesh mesh = make_organ_mesh({});
    double least = 180.0;
    for (const auto& t : mesh.triangles) {
        for (std::size_t i = 0; i < 3; ++i) {
            const Vec3& p = mesh.vertices[t[i]];
            const Vec3 u = glm::normalize(mesh.vertices[t[(i + 1) % 3]] - p);
            const Vec3 v = glm::normalize(mesh.vertices[t[(i + 2) % 3]] - p);
            least = std::min(least, std::acos(glm::dot(u, v)) * 57.29577951308232);
        }
    }
    EXPECT_GT(least, 4.0);  // degrees, on the thin edge
    // Refined, the angles between neighbouring triangles shrink as on a smooth surface, by half each time.
    const auto sharpest = [](std::uint32_t refinements) {
        const TriangleMesh refined = make_organ_mesh({.refinements = refinements});
        double lowest_cosine = 1.0;
        const auto sides = organ_sides(refined);
        for (const auto& [side, triangles] : sides) {
            const std::size_t other = sides.at({side.second, side.first}).front();
            lowest_cosine = std::min(lowest_cosine,
                                     glm::dot(organ_normal(refined, triangles.front()), organ_normal(refined, other)));
        }
        return std::acos(lowest_cosine);
    };
    EXPECT_LT(sharpest(4), 0.6 * sharpest(3));
}

TEST(Organ, ScalesWithItsLength) {
    const TriangleMesh mesh = make_organ_mesh({});
    const TriangleMesh twice = make_organ_mesh({.length = 0.4});
    ASSERT_EQ(mesh.triangles, twice.triangles);
    for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
        EXPECT_EQ(twice.vertices[i], 2.0 * mesh.vertices[i]);
    }
}

TEST(Organ, IsTheSameEachTime) {
    const TriangleMesh first = make_organ_mesh({});
    const TriangleMesh second = make_organ_mesh({});
    EXPECT_EQ(first.vertices, second.vertices);
    EXPECT_EQ(first.triangles, second.triangles);
}

TEST(Organ, RefusesInvalidShapes) {
    EXPECT_THROW((void)make_organ_mesh({.length = 0.0}), std::invalid_argument);
    EXPECT_THROW((void)make_organ_mesh({.length = -0.2}), std::invalid_argument);
    EXPECT_THROW((void)make_organ_mesh({.length = std::numeric_limits<double>::infinity()}), std::invalid_argument);
    EXPECT_THROW((void)make_organ_mesh({.refinements = 6}), std::invalid_argument);
}

}  // namespace
}  // namespace haptic::sim
