// Polygon triangulation by ear clipping.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "haptic/sim/mesh.hpp"

namespace haptic::sim::detail {

/// Splits a polygon with n >= 3 corners into n - 2 triangles with the same winding (indices into `corners`). Exact for
/// a simple planar polygon, convex or not. A polygon that intersects itself or has no area also gives n - 2 triangles,
/// without further guarantee. O(n^3) worst case, usually O(n^2).
/// @source G. H. Meisters, "Polygons Have Ears", 1975: every simple polygon with more than three corners has two ears
[[nodiscard]] std::vector<Triangle> cut_polygon(std::span<const Vec3> corners);

}  // namespace haptic::sim::detail
