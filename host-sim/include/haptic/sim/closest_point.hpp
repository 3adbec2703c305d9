// Closest point on a triangle.
#pragma once

#include <cstdint>

#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// The part of a triangle that a sphere touches.
enum class Feature : std::uint8_t { None, Face, Edge, Vertex };

/// Its name in query files and reports: none, face, edge, vertex.
[[nodiscard]] const char* describe(Feature feature) noexcept;

/// Vertices of a triangle, m.
struct TriangleCorners {
    Vec3 a{0.0};
    Vec3 b{0.0};
    Vec3 c{0.0};
};

/// Closest point on a triangle, with its Voronoi region.
struct ClosestPoint {
    Vec3 point{0.0};                // m
    Vec3 weights{1.0, 0.0, 0.0};    // barycentric, each >= 0, sum 1; exactly 0 for uninvolved vertices
    double squared_distance = 0.0;  // m^2
    Feature feature = Feature::None;
    std::uint8_t index = 0;  // Vertex: 0 a, 1 b, 2 c. Edge: 0 ab, 1 bc, 2 ca
};

/// Finds the point of a triangle closest to p, by its seven Voronoi regions. A degenerate triangle is treated as a
/// segment or a point, so the result is finite and on the triangle for every finite input. No libm, no allocation.
/// @source Ericson 2005, Real-Time Collision Detection, 5.1.5; differs for degenerate triangles, which use their three
/// edges.
[[nodiscard]] ClosestPoint closest_point_on_triangle(const Vec3& p, const TriangleCorners& triangle) HAPTIC_RT;

/// Point of a triangle with the given barycentric weights.
[[nodiscard]] inline Vec3 blend(const TriangleCorners& t, const Vec3& weights) HAPTIC_RT {
    return t.a * weights.x + t.b * weights.y + t.c * weights.z;
}

}  // namespace haptic::sim
