// Mesh refinement: smaller triangles for a mesh that is coarser than its use.
#pragma once

#include <cstddef>

#include "haptic/sim/mesh.hpp"

namespace haptic::sim {

/// Splits triangles until no edge is longer than `max_edge`, m, at edge midpoints shared by all triangles of the edge.
/// The children of a triangle take its place in the order, with its winding. Stops early, with longer edges left, once
/// there are more than `max_vertices`.
[[nodiscard]] TriangleMesh refined(const TriangleMesh& mesh, double max_edge, std::size_t max_vertices);

}  // namespace haptic::sim
