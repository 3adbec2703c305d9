#include "collision/feature_distance.hpp"

#include <algorithm>
#include <glm/geometric.hpp>

#include "haptic/sim/closest_point.hpp"

namespace haptic::sim {
namespace {

/// Part of the segment from `from` along `edge`, in 0..1, that is nearest to p.
double nearest_part(const Vec3& p, const Vec3& from, const Vec3& edge) noexcept {
    const double squared = glm::dot(edge, edge);
    return squared > 0.0 ? std::clamp(glm::dot(p - from, edge) / squared, 0.0, 1.0) : 0.0;
}

NearestPoints of_edges(const FeatureVertices& x) noexcept {
    const Vec3 e = x[1] - x[0];
    const Vec3 f = x[3] - x[2];
    const Vec3 apart = x[0] - x[2];
    const double ee = glm::dot(e, e);
    const double ff = glm::dot(f, f);
    const double ef = glm::dot(e, f);
    // Nearest points of the lines, then of the segments: clamp one, find the other for it, and clamp and find again.
    const Vec3 across = glm::cross(e, f);
    const double determinant = glm::dot(across, across);
    double s = 0.5;
    if (determinant > kParallelEdges * kParallelEdges * ee * ff) {
        s = std::clamp((ef * glm::dot(f, apart) - ff * glm::dot(e, apart)) / determinant, 0.0, 1.0);
    }
    const double t = nearest_part(x[0] + s * e, x[2], f);
    s = nearest_part(x[2] + t * f, x[0], e);
    NearestPoints result;
    result.weight = {1.0 - s, s, t - 1.0, -t};
    result.apart = apart + s * e - t * f;
    return result;
}

NearestPoints of_vertex_and_triangle(const FeatureVertices& x) noexcept {
    const ClosestPoint nearest = closest_point_on_triangle(x[0], {x[1], x[2], x[3]});
    NearestPoints result;
    result.weight = {1.0, -nearest.weights.x, -nearest.weights.y, -nearest.weights.z};
    result.apart = x[0] - nearest.point;
    return result;
}

}  // namespace

NearestPoints nearest_points(PairKind kind, const FeatureVertices& x) noexcept {
    NearestPoints result = kind == PairKind::VertexTriangle ? of_vertex_and_triangle(x) : of_edges(x);
    result.distance = glm::length(result.apart);
    return result;
}

}  // namespace haptic::sim
