#include "mesh/polygon.hpp"

#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <numeric>

namespace haptic::sim::detail {
namespace {

using Vec2 = glm::dvec2;

/// Projects the polygon along the axis of its largest area, so that it runs counter-clockwise.
std::vector<Vec2> flattened(std::span<const Vec3> corners) {
    Vec3 normal(0.0);  // twice the projected area along each axis
    for (std::size_t i = 0; i < corners.size(); ++i) {
        normal += glm::cross(corners[i] - corners[0], corners[(i + 1) % corners.size()] - corners[0]);
    }
    int axis = std::fabs(normal.y) > std::fabs(normal.x) ? 1 : 0;
    axis = std::fabs(normal.z) > std::fabs(normal[axis]) ? 2 : axis;
    const int first = (axis + (normal[axis] < 0.0 ? 2 : 1)) % 3;
    const int second = 3 - axis - first;
    std::vector<Vec2> flat;
    flat.reserve(corners.size());
    for (const Vec3& corner : corners) {
        flat.emplace_back(corner[first] - corners[0][first], corner[second] - corners[0][second]);
    }
    return flat;
}

/// Twice the signed area of the triangle abc: positive if counter-clockwise (Ericson, section 3.1.6.1).
double orient2d(const Vec2& a, const Vec2& b, const Vec2& c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

/// Whether corner `at` of the remaining polygon is an ear: convex, with no other corner in its triangle.
bool is_ear(const std::vector<Vec2>& flat, const std::vector<std::uint32_t>& rest, std::size_t at) {
    const std::size_t n = rest.size();
    const Vec2& a = flat[rest[(at + n - 1) % n]];
    const Vec2& b = flat[rest[at]];
    const Vec2& c = flat[rest[(at + 1) % n]];
    if (!(orient2d(a, b, c) > 0.0)) {
        return false;
    }
    for (std::size_t i = 2; i + 1 < n; ++i) {
        const Vec2& p = flat[rest[(at + i) % n]];
        // The border counts as inside. A coincident corner does not: a bridge to a hole has each of its corners twice.
        if (p != a && p != b && p != c && orient2d(a, b, p) >= 0.0 && orient2d(b, c, p) >= 0.0 &&
            orient2d(c, a, p) >= 0.0) {
            return false;
        }
    }
    return true;
}

}  // namespace

std::vector<Triangle> cut_polygon(std::span<const Vec3> corners) {
    const std::vector<Vec2> flat = flattened(corners);
    std::vector<std::uint32_t> rest(corners.size());
    std::iota(rest.begin(), rest.end(), 0U);
    std::vector<Triangle> triangles;
    triangles.reserve(corners.size() - 2);
    for (std::size_t n = corners.size(); n > 3; --n) {
        std::size_t at = 1;  // a rectangle is split along the diagonal from its first corner
        while (at <= n && !is_ear(flat, rest, at % n)) {
            ++at;
        }
        at = at <= n ? at % n : 1;  // no ear: not a simple polygon
        triangles.push_back({rest[(at + n - 1) % n], rest[at], rest[(at + 1) % n]});
        rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(at));
    }
    triangles.push_back({rest[0], rest[1], rest[2]});
    return triangles;
}

}  // namespace haptic::sim::detail
