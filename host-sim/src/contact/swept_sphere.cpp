#include "contact/swept_sphere.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>

namespace haptic::sim {

namespace {

// A fraction beyond the end of the move.
constexpr double kNever = 2.0;

/// Smaller root of a t^2 + 2 b t + c, where c > 0 outside; kNever without approach. The form c / (-b + sqrt(..)) does
/// not cancel.
double first_root(double a, double b, double c) HAPTIC_RT {
    if (b >= 0.0) {
        return kNever;
    }
    if (c <= 0.0) {
        return 0.0;
    }
    const double discriminant = b * b - a * c;
    if (discriminant < 0.0) {
        return kNever;
    }
    return c / (-b + std::sqrt(discriminant));
}

/// Centre against the sphere around a vertex: |m + t d| = radius.
double against_corner(const Vec3& from, const Vec3& d, double radius, const Vec3& corner) HAPTIC_RT {
    const Vec3 m = from - corner;
    return first_root(glm::dot(d, d), glm::dot(m, d), glm::dot(m, m) - radius * radius);
}

/// Centre against the cylinder around an edge, between its ends.
double against_edge(const Vec3& from, const Vec3& d, double radius, const Vec3& p, const Vec3& q) HAPTIC_RT {
    const Vec3 e = q - p;
    const double ee = glm::dot(e, e);
    if (ee == 0.0) {
        return kNever;
    }
    // Components perpendicular to the edge reduce it to a circle.
    const Vec3 m = from - p;
    const Vec3 across_m = m - e * (glm::dot(m, e) / ee);
    const Vec3 across_d = d - e * (glm::dot(d, e) / ee);
    const double c = glm::dot(across_m, across_m) - radius * radius;
    if (c <= 0.0) {
        return kNever;  // starts beyond an end of the edge: a vertex is met first
    }
    const double t = first_root(glm::dot(across_d, across_d), glm::dot(across_m, across_d), c);
    if (t > 1.0) {
        return kNever;
    }
    // The hit counts only between the ends.
    const double along = glm::dot(m + d * t, e);
    return along >= 0.0 && along <= ee ? t : kNever;
}

/// Centre against the face offset by the radius, on the side where the centre starts.
double against_face(const Vec3& from, const Vec3& d, double radius, const TriangleCorners& t) HAPTIC_RT {
    const Vec3 normal = glm::cross(t.b - t.a, t.c - t.a);
    const double length2 = glm::dot(normal, normal);
    if (length2 == 0.0) {
        return kNever;
    }
    // Height above the plane and approach speed along its normal.
    const Vec3 up = normal / std::sqrt(length2);
    const double height = glm::dot(up, from - t.a);
    const Vec3 n = height < 0.0 ? -up : up;
    const double above = std::abs(height) - radius;
    const double rate = -glm::dot(n, d);
    if (above < 0.0 || rate <= 0.0 || above > rate) {
        return kNever;
    }
    // Touched point of the plane, and whether it is inside the triangle (same orientation for all three edges).
    const double time = above / rate;
    const Vec3 x = from + d * time - n * radius;
    const Vec3 a = t.a - x;
    const Vec3 b = t.b - x;
    const Vec3 c = t.c - x;
    const bool inside = glm::dot(normal, glm::cross(a, b)) >= 0.0 && glm::dot(normal, glm::cross(b, c)) >= 0.0 &&
                        glm::dot(normal, glm::cross(c, a)) >= 0.0;
    return inside ? time : kNever;
}

}  // namespace

SphereHit sweep_sphere(const Vec3& from, const Vec3& displacement, double radius, double distance,
                       const TriangleCorners& t) HAPTIC_RT {
    // Already within the radius: stopped only if it approaches.
    if (distance <= radius) {
        const Vec3 nearest = closest_point_on_triangle(from, t).point;
        return glm::dot(from - nearest, displacement) < 0.0 ? SphereHit{true, 0.0} : SphereHit{};
    }
    double first = against_face(from, displacement, radius, t);
    if (first > 1.0) {
        // Only if the face is missed can an edge or a vertex be first.
        first = std::min(
            {against_edge(from, displacement, radius, t.a, t.b), against_edge(from, displacement, radius, t.b, t.c),
             against_edge(from, displacement, radius, t.c, t.a), against_corner(from, displacement, radius, t.a),
             against_corner(from, displacement, radius, t.b), against_corner(from, displacement, radius, t.c)});
    }
    return first <= 1.0 ? SphereHit{true, first} : SphereHit{};
}

}  // namespace haptic::sim
