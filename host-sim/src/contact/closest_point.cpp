#include "haptic/sim/closest_point.hpp"

#include <glm/geometric.hpp>

namespace haptic::sim {

namespace {

// A triangle whose height is below this fraction of its sides is treated as its three edges. The closest point is then
// off by at most half the height, which changes the distance d by less than height^2 / (8 d): nothing at double
// precision.
constexpr double kSliver = 1e-7;

/// Result at a vertex.
ClosestPoint at_vertex(const Vec3& p, const Vec3& vertex, std::uint8_t index) HAPTIC_RT {
    ClosestPoint result;
    result.point = vertex;
    result.weights = Vec3(0.0);
    result.weights[index] = 1.0;
    const Vec3 d = p - vertex;
    result.squared_distance = glm::dot(d, d);
    result.feature = Feature::Vertex;
    result.index = index;
    return result;
}

/// Result on an edge, at `fraction` of its length.
ClosestPoint at_edge(const Vec3& p, const Vec3& from, const Vec3& to, double fraction, std::uint8_t index) HAPTIC_RT {
    ClosestPoint result;
    result.point = from + (to - from) * fraction;
    result.weights = Vec3(0.0);
    result.weights[index] = 1.0 - fraction;
    result.weights[(index + 1) % 3] = fraction;
    const Vec3 d = p - result.point;
    result.squared_distance = glm::dot(d, d);
    result.feature = Feature::Edge;
    result.index = index;
    return result;
}

/// Closest point on a segment (Ericson 5.1.2).
ClosestPoint on_segment(const Vec3& p, const Vec3& from, const Vec3& to, std::uint8_t index) HAPTIC_RT {
    const Vec3 e = to - from;
    const double along = glm::dot(p - from, e);
    const double length2 = glm::dot(e, e);
    if (!(along > 0.0)) {
        return at_vertex(p, from, index);
    }
    if (along >= length2) {
        return at_vertex(p, to, static_cast<std::uint8_t>((index + 1) % 3));
    }
    return at_edge(p, from, to, along / length2, index);
}

/// Closest point on the three edges.
ClosestPoint on_edges(const Vec3& p, const TriangleCorners& t) HAPTIC_RT {
    ClosestPoint best = on_segment(p, t.a, t.b, 0);
    const ClosestPoint bc = on_segment(p, t.b, t.c, 1);
    if (bc.squared_distance < best.squared_distance) {
        best = bc;
    }
    const ClosestPoint ca = on_segment(p, t.c, t.a, 2);
    if (ca.squared_distance < best.squared_distance) {
        best = ca;
    }
    return best;
}

}  // namespace

const char* describe(Feature feature) noexcept {
    switch (feature) {
        case Feature::Face:
            return "face";
        case Feature::Edge:
            return "edge";
        case Feature::Vertex:
            return "vertex";
        case Feature::None:
            break;
    }
    return "none";
}

ClosestPoint closest_point_on_triangle(const Vec3& p, const TriangleCorners& t) HAPTIC_RT {
    // Vertex regions (Ericson 5.1.5): along both adjacent edges the point projects onto or before the vertex.
    const Vec3 ab = t.b - t.a;
    const Vec3 ac = t.c - t.a;
    const Vec3 ap = p - t.a;
    const double d1 = glm::dot(ab, ap);
    const double d2 = glm::dot(ac, ap);
    if (d1 <= 0.0 && d2 <= 0.0) {
        return at_vertex(p, t.a, 0);
    }
    const Vec3 bp = p - t.b;
    const double d3 = glm::dot(ab, bp);
    const double d4 = glm::dot(ac, bp);
    if (d3 >= 0.0 && d4 <= d3) {
        return at_vertex(p, t.b, 1);
    }
    const Vec3 cp = p - t.c;
    const double d5 = glm::dot(ab, cp);
    const double d6 = glm::dot(ac, cp);
    if (d6 >= 0.0 && d5 <= d6) {
        return at_vertex(p, t.c, 2);
    }
    // Degenerate triangle.
    const Vec3 n = glm::cross(ab, ac);
    const double nn = glm::dot(n, n);
    if (!(nn > kSliver * kSliver * glm::dot(ab, ab) * glm::dot(ac, ac))) {
        return on_edges(p, t);
    }
    // Edge regions, by the signed areas opposite to each vertex. Cross products replace the book's products of d1..d6,
    // which lose digits to cancellation in thin triangles.
    const double vc = glm::dot(n, glm::cross(ap, bp));
    if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) {
        return at_edge(p, t.a, t.b, d1 / (d1 - d3), 0);
    }
    const double vb = glm::dot(n, glm::cross(cp, ap));
    if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) {
        return at_edge(p, t.c, t.a, 1.0 - d2 / (d2 - d6), 2);
    }
    const double va = glm::dot(n, glm::cross(bp, cp));
    const double toward_c = d4 - d3;
    const double toward_b = d5 - d6;
    if (va <= 0.0 && toward_c >= 0.0 && toward_b >= 0.0) {
        return at_edge(p, t.b, t.c, toward_c / (toward_c + toward_b), 1);
    }
    if (va < 0.0 || vb < 0.0 || vc < 0.0) {
        return on_edges(p, t);  // rounding made the regions contradict each other
    }
    // Face region: barycentric weights are the normalised areas.
    ClosestPoint result;
    result.weights = Vec3(va, vb, vc) / (va + vb + vc);
    result.point = t.a + ab * result.weights.y + ac * result.weights.z;
    const Vec3 d = p - result.point;
    result.squared_distance = glm::dot(d, d);
    result.feature = Feature::Face;
    return result;
}

}  // namespace haptic::sim
