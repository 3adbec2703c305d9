// Volume and area of a mesh.
#pragma once

#include "haptic/sim/mesh.hpp"

namespace haptic::sim {

/// Volume enclosed by a closed mesh, m^3; negative if its triangles face inward.
[[nodiscard]] double signed_volume(const TriangleMesh& mesh);
/// m^2
[[nodiscard]] double surface_area(const TriangleMesh& mesh);

}  // namespace haptic::sim
