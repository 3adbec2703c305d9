// Cloth generator: a square sheet, so that the built-in scenes need no mesh file.
#pragma once

#include <cstdint>
#include <vector>

#include "haptic/sim/mesh.hpp"
#include "haptic/sim/particles.hpp"

namespace haptic::sim {

struct ClothShape {
    std::uint32_t vertices_per_side = 33;  // at least 2; 33 gives the 1,089 vertices and 4,096 triangles of the thesis
    double side = 1.0;                     // m
    double mass = 0.1;                     // kg, of the whole cloth, the same for each vertex
    Vec3 centre{0.0, 0.0, 0.0};            // m
    Quat orientation{1.0, 0.0, 0.0, 0.0};  // scene_from_cloth; the cloth lies in its x-z plane
};

/// A horizontal square grid, two triangles a cell, each triangle also with reversed winding (the "double-faced" cloth
/// of the thesis, section 4.4.1). Front faces come first. Diagonals alternate, so that the cloth has no preferred
/// direction. Vertex (column i, row j) has index j * vertices_per_side + i, at x = i, z = j. Throws
/// std::invalid_argument.
[[nodiscard]] TriangleMesh make_cloth_mesh(const ClothShape& shape);

/// One oriented particle per vertex of make_cloth_mesh, in the same order. Each forms a shape-matching group with its
/// up to eight neighbours on the grid and has a distance constraint to each. They collide as balls that touch along the
/// grid.
/// @source thesis, section 4.4.1
[[nodiscard]] ParticleModel make_cloth_particles(const ClothShape& shape, double group_stiffness,
                                                 double link_stiffness);

}  // namespace haptic::sim
