// Polygons as triangles.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <haptic/sim/mesh.hpp>

namespace haptic::sim::detail {

/// Cuts a polygon with n >= 3 corners into n - 2 triangles of its corners (indices into `corners`), in its own sense,
/// by cutting off ears: exact for a simple polygon in a plane, convex or not. One that crosses itself, or has no area,
/// is cut into n - 2 triangles too, of which nothing more is promised. O(n^3) at worst, O(n^2) as a rule.
/// @source Meisters 1975, Polygons Have Ears: every simple polygon of more than three corners has two
[[nodiscard]] std::vector<Triangle> cut_polygon(std::span<const Vec3> corners);

}  // namespace haptic::sim::detail
