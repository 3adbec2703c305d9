// A hanging curtain, generated: the cloth of the thesis' chapter 5 (section 5.5.1).
#pragma once

#include <cstdint>

#include "haptic/sim/cloth.hpp"

namespace haptic::sim {

struct CurtainShape {
    std::uint32_t vertices_per_side = 33;  // 2 to 1024; 33 gives the 1,089 vertices and 4,096 triangles of the thesis
    double side = 8.0;                     // m
    double mass = 0.2;                     // kg, of the whole curtain, spread evenly over the vertices
    Vec3 centre{0.0, 0.0, 0.0};            // m
    Quat orientation{1.0, 0.0, 0.0, 0.0};  // scene_from_curtain; the curtain hangs in its x-y plane

    /// Throws std::invalid_argument.
    void check() const;
};

/// The cloth of make_cloth_mesh, double-faced too, upright: vertex (column i, row j) has index j * vertices_per_side +
/// i, at x = i, y = -j. The first vertices_per_side vertices are its upper edge. Front faces look along +z. Throws
/// std::invalid_argument.
[[nodiscard]] TriangleMesh make_curtain_mesh(const CurtainShape& shape);

/// One oriented particle for each vertex, linked as those of the cloth; the upper edge is pinned.
[[nodiscard]] ParticleModel make_curtain_particles(const CurtainShape& shape, double group_stiffness,
                                                   double link_stiffness);

}  // namespace haptic::sim
