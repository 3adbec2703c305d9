// Organ generator: a smooth solid in the shape of a liver, to press, lift and cut into.
//
// A geodesic sphere, deformed by smooth functions that are invertible one by one, so that the surface cannot intersect
// itself. The thick lobe is at -x and the thin one at +x; the dome faces +y, the sharp edge with the notch between the
// lobes +z.
#pragma once

#include <cstddef>
#include <cstdint>

#include "haptic/sim/mesh.hpp"

namespace haptic::sim {

struct OrganShape {
    double length = 0.2;            // m, along x
    std::uint32_t refinements = 0;  // 0..5: each divides every triangle into four, on the smooth surface

    /// Throws std::invalid_argument.
    void check() const;
};

/// Triangles of make_organ_mesh: 1,620 without refinements.
[[nodiscard]] std::size_t organ_triangles(const OrganShape& shape) noexcept;

/// Closed surface about the origin, oriented outward. Uses + - * / and sqrt only, so its bits are the same on every
/// machine. Throws std::invalid_argument.
[[nodiscard]] TriangleMesh make_organ_mesh(const OrganShape& shape);

}  // namespace haptic::sim
