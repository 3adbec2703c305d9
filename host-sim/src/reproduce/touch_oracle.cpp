#include "reproduce/touch_oracle.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace haptic::sim::reproduce {

namespace {

constexpr std::size_t kMaxDepth = 60;  // bisections: intervals of 1e-18

double squared_to_segment(const Vec3& a, const Vec3& b) {
    const Vec3 e = b - a;
    const double ee = glm::dot(e, e);
    const double s = ee > 0.0 ? std::clamp(-glm::dot(a, e) / ee, 0.0, 1.0) : 0.0;
    const Vec3 nearest = a + s * e;
    return glm::dot(nearest, nearest);
}

struct Interval {
    double begin;
    double length;
};

}  // namespace

double point_triangle_distance(const Vec3& p, const Corners& triangle) {
    const Vec3 a = triangle[0] - p;
    const Vec3 b = triangle[1] - p;
    const Vec3 c = triangle[2] - p;
    const Vec3 n = glm::cross(b - a, c - a);
    const double nn = glm::dot(n, n);
    // The foot of the perpendicular is inside if its three triangles with the edges have the same orientation.
    if (nn > 0.0 && glm::dot(n, glm::cross(a, b)) >= 0.0 && glm::dot(n, glm::cross(b, c)) >= 0.0 &&
        glm::dot(n, glm::cross(c, a)) >= 0.0) {
        return std::abs(glm::dot(n, a)) / std::sqrt(nn);
    }
    return std::sqrt(std::min({squared_to_segment(a, b), squared_to_segment(b, c), squared_to_segment(c, a)}));
}

Corners corners_at_time(const LinearTriangle& triangle, double time) {
    Corners corners{};
    for (std::size_t k = 0; k < corners.size(); ++k) {
        corners[k] = triangle.start[k] + time * (triangle.end[k] - triangle.start[k]);
    }
    return corners;
}

OracleTouch first_time_within(const Vec3& p, double radius, const LinearTriangle& triangle) {
    // Lipschitz bound: no point of the triangle moves farther than its fastest corner.
    double fastest = 0.0;
    for (std::size_t k = 0; k < triangle.start.size(); ++k) {
        fastest = std::max(fastest, glm::length(triangle.end[k] - triangle.start[k]));
    }
    const auto distance_at = [&](double t) { return point_triangle_distance(p, corners_at_time(triangle, t)); };
    if (distance_at(0.0) <= radius) {
        return {Verdict::Touches, 0.0};
    }
    // A contact bounds the search: only earlier times are examined further.
    OracleTouch touch{Verdict::Clear, 2.0};
    if (distance_at(1.0) <= radius) {
        touch = {Verdict::Touches, 1.0};
    }
    std::array<Interval, kMaxDepth + 1> stack{};
    std::size_t depth = 0;
    stack[depth++] = {0.0, 1.0};
    for (int evaluations = 0; depth > 0; ++evaluations) {
        const Interval interval = stack[--depth];
        if (interval.begin >= touch.time) {
            break;
        }
        if (evaluations == kMaxEvaluations) {
            return {Verdict::Undecided, 2.0};
        }
        // Evaluate the distance at the middle of the earliest open interval.
        const double half = 0.5 * interval.length;
        const double middle = interval.begin + half;
        const double distance = distance_at(middle);
        if (distance <= radius && middle < touch.time) {
            touch = {Verdict::Touches, middle};
        }
        // Discard the interval if the bound excludes a contact, or if it is too short to matter.
        const bool short_enough = fastest * half <= kGrazing * radius || half < 1e-15;
        if (distance - fastest * half > radius || short_enough || depth + 2 > stack.size()) {
            continue;
        }
        // Examine the first half first: push it last.
        stack[depth++] = {middle, half};
        stack[depth++] = {interval.begin, half};
    }
    return touch;
}

}  // namespace haptic::sim::reproduce
