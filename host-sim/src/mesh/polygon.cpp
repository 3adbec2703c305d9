#include "mesh/polygon.hpp"

#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <numeric>

namespace haptic::sim::detail {
namespace {

using Vec2 = glm::dvec2;

/// Drops the coordinate along which the polygon has most area, so that it runs counter-clockwise.
std::vector<Vec2> flattened(std::span<const Vec3> corners) {
    Vec3 normal(0.0);  // Newell: twice the area, seen along each axis
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

/// Twice the area to the left of a-b-c.
double turn(const Vec2& a, const Vec2& b, const Vec2& c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

/// Whether the corner at `place` of what is left sticks out, with nothing else of the polygon in its triangle.
bool is_ear(const std::vector<Vec2>& flat, const std::vector<std::uint32_t>& left, std::size_t place) {
    const std::size_t n = left.size();
    const Vec2& a = flat[left[(place + n - 1) % n]];
    const Vec2& b = flat[left[place]];
    const Vec2& c = flat[left[(place + 1) % n]];
    if (!(turn(a, b, c) > 0.0)) {
        return false;
    }
    for (std::size_t i = 2; i + 1 < n; ++i) {
        const Vec2& p = flat[left[(place + i) % n]];
        // The border counts as inside; another corner at the same place does not, because a bridge to a hole has two.
        if (p != a && p != b && p != c && turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0) {
            return false;
        }
    }
    return true;
}

}  // namespace

std::vector<Triangle> cut_polygon(std::span<const Vec3> corners) {
    const std::vector<Vec2> flat = flattened(corners);
    std::vector<std::uint32_t> left(corners.size());
    std::iota(left.begin(), left.end(), 0U);
    std::vector<Triangle> triangles;
    triangles.reserve(corners.size() - 2);
    for (std::size_t n = corners.size(); n > 3; --n) {
        std::size_t place = 1;  // a rectangle is cut along its first corner
        while (place <= n && !is_ear(flat, left, place % n)) {
            ++place;
        }
        place = place <= n ? place % n : 1;  // without an ear it is no simple polygon
        triangles.push_back({left[(place + n - 1) % n], left[place], left[(place + 1) % n]});
        left.erase(left.begin() + static_cast<std::ptrdiff_t>(place));
    }
    triangles.push_back({left[0], left[1], left[2]});
    return triangles;
}

}  // namespace haptic::sim::detail
