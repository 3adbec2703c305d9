#include "tool/uncovered_depth.hpp"

#include <algorithm>
#include <glm/geometric.hpp>

namespace haptic::sim {
namespace {

constexpr double kRelativeError = 0.01;
constexpr int kMaxDivisions = 60;  // bisections: down to 2^-30 of a side

/// The triangle with its corners permuted cyclically so that the longest side runs from a to b.
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

void UncoveredDepth::measure(const Vec3& p) {
    double distance = std::numeric_limits<double>::infinity();
    for (const Ball& ball : balls_) {
        distance = std::min(distance, glm::length(p - ball.centre) - ball.radius);
    }
    if (distance > max_seen_) {
        max_seen_ = distance;
        farthest_ = p;
    }
}

void UncoveredDepth::add(const TriangleCorners& triangle, int divisions) {
    // Bound of this triangle: min over the balls of the max over the corners. Prune if it cannot raise the total.
    double bound = std::numeric_limits<double>::infinity();
    for (const Ball& ball : balls_) {
        const double farthest = std::max({glm::length(triangle.a - ball.centre), glm::length(triangle.b - ball.centre),
                                          glm::length(triangle.c - ball.centre)});
        bound = std::min(bound, farthest - ball.radius);
    }
    if (bound <= bound_) {
        return;
    }
    // Raise the lower bound at the corners; stop where the two bounds meet.
    measure(triangle.a);
    measure(triangle.b);
    measure(triangle.c);
    if (bound - max_seen_ <= std::max(resolution_, kRelativeError * max_seen_) || divisions == kMaxDivisions) {
        bound_ = bound;
        return;
    }
    // Bisect the longest side, which keeps the pieces well shaped.
    const TriangleCorners t = longest_first(triangle);
    const Vec3 middle = 0.5 * (t.a + t.b);
    add({t.a, middle, t.c}, divisions + 1);
    add({middle, t.b, t.c}, divisions + 1);
}

}  // namespace haptic::sim
