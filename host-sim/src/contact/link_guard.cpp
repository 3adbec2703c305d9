#include "contact/link_guard.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>

#include "haptic/sim/closest_point.hpp"

namespace haptic::sim {
namespace {

using Corners = std::array<Vec3, 3>;

// Of a normal: if its component across the segment is shorter, the direction of that component is arbitrary.
constexpr double kMinNormalShare = 0.05;

/// Six times the signed volume of a tetrahedron.
double volume(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
    return glm::dot(b - a, glm::cross(c - a, d - a));
}

/// Point where the segment from p to q crosses a triangle from one side to the other, border included (Ericson 5.3.4).
std::optional<Vec3> intersection(const Vec3& p, const Vec3& q, const Corners& t) {
    // The ends must be on opposite sides of the plane.
    const double before = volume(t[0], t[1], t[2], p);
    const double after = volume(t[0], t[1], t[2], q);
    if ((before > 0.0) == (after > 0.0) || before == after) {
        return std::nullopt;
    }
    // The line must pass all edges on the same side.
    const double u = volume(p, q, t[0], t[1]);
    const double v = volume(p, q, t[1], t[2]);
    const double w = volume(p, q, t[2], t[0]);
    const bool inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    if (!inside) {
        return std::nullopt;
    }
    return p + (before / (before - after)) * (q - p);
}

double distance_from_segment(const Vec3& point, const Vec3& a, const Vec3& b) {
    const Vec3 along = b - a;
    const double square = glm::dot(along, along);
    const double part = square > 0.0 ? std::clamp(glm::dot(point - a, along) / square, 0.0, 1.0) : 0.0;
    return glm::length(point - a - part * along);
}

/// Accumulates the intersection point of two triangles' borders that is nearest to the segment a b.
struct NearestIntersection {
    Vec3 a;
    Vec3 b;
    double distance = std::numeric_limits<double>::infinity();
    Vec3 point{0.0};

    /// Tests the edges of one triangle against the other.
    void consider(const Corners& one, const Corners& other) {
        for (std::size_t k = 0; k < 3; ++k) {
            if (const auto at = intersection(one[k], one[(k + 1) % 3], other)) {
                const double separation = distance_from_segment(*at, a, b);
                if (separation < distance) {
                    distance = separation;
                    point = *at;
                }
            }
        }
    }
};

Aabb box_of_move(const LinkMove& move) {
    return {glm::min(glm::min(move.a0, move.b0), glm::min(move.a1, move.b1)),
            glm::max(glm::max(move.a0, move.b0), glm::max(move.a1, move.b1))};
}

/// Unit normal at the hit: perpendicular to the segment, out of the triangle, toward the segment before the move.
Vec3 normal_of(const LinkMove& move, const Corners& corners, const Vec3& point) {
    // Projection onto the plane perpendicular to the segment.
    const Vec3 along = move.b0 - move.a0;
    const double square = glm::dot(along, along);
    const auto across = [&](const Vec3& v) { return square > 0.0 ? v - (glm::dot(v, along) / square) * along : v; };
    const Vec3 face = glm::cross(corners[1] - corners[0], corners[2] - corners[0]);
    const Vec3 back = move.a0 + move.b0 - move.a1 - move.b1;  // opposite to the move
    // The face's normal; if it is nearly parallel to the segment, the direction back instead.
    Vec3 normal = across(face);
    if (!(glm::length(normal) > kMinNormalShare * glm::length(face))) {
        normal = across(back);
    }
    const double length = glm::length(normal);
    if (!(length > 0.0)) {
        return {0.0, 1.0, 0.0};
    }
    // Orient it toward the segment.
    const Vec3 side = across(0.5 * (move.a0 + move.b0) - point);
    return glm::dot(normal, side) < 0.0 ? -normal / length : normal / length;
}

}  // namespace

std::optional<LinkHit> find_link_hit(std::span<const MovingSurface> surfaces, const LinkMove& move) {
    const Aabb box = box_of_move(move);
    // The two triangles of the patch.
    const std::array<Corners, 2> patch{{{move.a0, move.b0, move.b1}, {move.a0, move.b1, move.a1}}};
    NearestIntersection nearest{move.a0, move.b0};
    LinkHit hit;
    Corners touched{};
    bool crossed_before = false;
    for (std::size_t object = 0; object < surfaces.size(); ++object) {
        const SurfaceMotion& motion = surfaces[object].motion;
        surfaces[object].tree->query(box, [&](std::uint32_t index) {
            const Triangle& t = motion.triangles[index];
            const Corners corners{motion.end[t[0]], motion.end[t[1]], motion.end[t[2]]};
            // Does the triangle cross the segment before the move?
            crossed_before = crossed_before || intersection(move.a0, move.b0, corners).has_value();
            // Edges of the patch against the triangle, and edges of the triangle against the patch.
            const double before = nearest.distance;
            for (const Corners& half : patch) {
                nearest.consider(half, corners);
                nearest.consider(corners, half);
            }
            if (nearest.distance < before) {
                touched = corners;
                hit.plane.touched.object = static_cast<std::uint32_t>(object);
                hit.plane.touched.triangle = index;
            }
        });
    }
    if (crossed_before || !(nearest.distance < std::numeric_limits<double>::infinity())) {
        return std::nullopt;
    }
    // Normal, feature and barycentric weights of the nearest hit.
    hit.plane.normal = normal_of(move, touched, nearest.point);
    const ClosestPoint closest = closest_point_on_triangle(nearest.point, {touched[0], touched[1], touched[2]});
    hit.plane.touched.feature = closest.feature;
    hit.plane.touched.weights = closest.weights;
    return hit;
}

}  // namespace haptic::sim
