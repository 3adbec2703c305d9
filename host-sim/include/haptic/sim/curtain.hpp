// Curtain generator: the hanging cloth of the thesis' section 5.5.1.
#pragma once

#include <cstdint>

#include "haptic/sim/cloth.hpp"

namespace haptic::sim {

struct CurtainShape {
    std::uint32_t vertices_per_side = 33;  // 2 to 1024; 33 gives the 1,089 vertices and 4,096 triangles of the thesis
    double side = 8.0;                     // m
    double mass = 0.2;                     // kg, of the whole curtain, the same for each vertex
    Vec3 centre{0.0, 0.0, 0.0};            // m
    Quat orientation{1.0, 0.0, 0.0, 0.0};  // scene_from_curtain; the curtain hangs in its x-y plane

    /// Throws std::invalid_argument.
    void check() const;
};

/// The double-faced cloth of make_cloth_mesh, upright: vertex (column i, row j) has index j * vertices_per_side + i, at
/// x = i, y = -j. The first vertices_per_side vertices are the upper edge. Front faces look along +z. Throws
/// std::invalid_argument.
[[nodiscard]] TriangleMesh make_curtain_mesh(const CurtainShape& shape);

/// One oriented particle per vertex, with the constraints of the cloth; the upper edge is pinned.
[[nodiscard]] ParticleModel make_curtain_particles(const CurtainShape& shape, double group_stiffness,
                                                   double link_stiffness);

}  // namespace haptic::sim
