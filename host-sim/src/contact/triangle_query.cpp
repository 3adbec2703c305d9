#include "contact/triangle_query.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>

#include "contact/pop_out.hpp"
#include "contact/secure_position.hpp"
#include "contact/swept_tree.hpp"

namespace haptic::sim {
namespace {

/// Position of the centre after a step among this triangle alone: secure position, then pop-out.
Vec3 secured(const TriangleQuery& q) {
    const std::array<Vec3, 3> start{q.triangle.start.a, q.triangle.start.b, q.triangle.start.c};
    const std::array<Vec3, 3> end{q.triangle.end.a, q.triangle.end.b, q.triangle.end.c};
    const std::array<Triangle, 1> triangles{Triangle{0, 1, 2}};
    SweptTree tree(start, triangles);
    const SurfaceMotion motion{start, end, triangles};
    tree.refit(motion);
    const std::array<MovingSurface, 1> surfaces{MovingSurface{motion, &tree}};
    const ContactSettings settings;
    const SecurePosition secure = secure_position(surfaces, q.center, q.radius, settings);
    return pop_out(surfaces, secure.position, q.radius, settings).position;
}

/// Unit normal from the touched point to the centre; the face normal if they coincide.
Vec3 contact_normal(const TriangleQuery& q, const TriangleTouch& touch) {
    Vec3 n = -touch.at.point;
    double length = std::sqrt(glm::dot(n, n));
    if (!(length > 0.0)) {
        const TriangleCorners t = corners_at(q.triangle, touch.time);
        n = glm::cross(t.b - t.a, t.c - t.a);
        length = std::sqrt(glm::dot(n, n));
    }
    return length > 0.0 ? n / length : Vec3(0.0);
}

}  // namespace

TriangleAnswer answer(const TriangleQuery& query) {
    TriangleAnswer found;
    found.secure_position = query.center;
    const TriangleTouch touch = sphere_triangle_ccd(query.center, query.radius, query.triangle);
    if (!touch.touches) {
        return found;
    }
    found.touched = touch.at.feature;
    found.touch_time = touch.time;
    found.normal = contact_normal(query, touch);
    found.secure_position = secured(query);
    if (const PointPassage passage = point_passage(query.center, query.triangle); passage.passes) {
        found.passage_time = std::max(passage.time, touch.time);
    }
    return found;
}

}  // namespace haptic::sim
