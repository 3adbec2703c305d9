#include "tool/bare_depth.hpp"

#include <algorithm>
#include <glm/geometric.hpp>

namespace haptic::sim {
namespace {

constexpr double kExact = 0.01;
constexpr int kMostDivisions = 60;  // by halves: 2^-30 of a side

/// The same triangle, its longest side from a to b.
TriangleCorners longest_first(const TriangleCorners& t) {
    const Vec3 ab = t.b - t.a;
    const Vec3 bc = t.c - t.b;
    const Vec3 ca = t.a - t.c;
    if (glm::dot(ab, ab) >= glm::dot(bc, bc) && glm::dot(ab, ab) >= glm::dot(ca, ca)) {
        return t;
    }
    return glm::dot(bc, bc) >= glm::dot(ca, ca) ? TriangleCorners{t.b, t.c, t.a} : TriangleCorners{t.c, t.a, t.b};
}

}  // namespace

void BareDepth::look_at(const Vec3& p) {
    double least = std::numeric_limits<double>::infinity();
    for (const Ball& ball : balls_) {
        least = std::min(least, glm::length(p - ball.centre) - ball.radius);
    }
    if (least > seen_) {
        seen_ = least;
        farthest_ = p;
    }
}

void BareDepth::take(const TriangleCorners& triangle, int divisions) {
    double bound = std::numeric_limits<double>::infinity();
    for (const Ball& ball : balls_) {
        const double farthest = std::max({glm::length(triangle.a - ball.centre), glm::length(triangle.b - ball.centre),
                                          glm::length(triangle.c - ball.centre)});
        bound = std::min(bound, farthest - ball.radius);
    }
    if (bound <= bound_) {
        return;
    }
    look_at(triangle.a);
    look_at(triangle.b);
    look_at(triangle.c);
    if (bound - seen_ <= std::max(finest_, kExact * seen_) || divisions == kMostDivisions) {
        bound_ = bound;
        return;
    }
    const TriangleCorners t = longest_first(triangle);
    const Vec3 middle = 0.5 * (t.a + t.b);
    take({t.a, middle, t.c}, divisions + 1);
    take({middle, t.b, t.c}, divisions + 1);
}

}  // namespace haptic::sim
