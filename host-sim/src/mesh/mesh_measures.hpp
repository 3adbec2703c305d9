// Volume and area of a mesh.
#pragma once

#include <span>

#include "haptic/sim/mesh.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// Volume enclosed by a closed surface, m^3; negative if its triangles face inward.
[[nodiscard]] double signed_volume(std::span<const Vec3> vertices, std::span<const Triangle> triangles);
[[nodiscard]] inline double signed_volume(const TriangleMesh& mesh) {
    return signed_volume(mesh.vertices, mesh.triangles);
}
/// m^2
[[nodiscard]] double surface_area(const TriangleMesh& mesh);

}  // namespace haptic::sim
