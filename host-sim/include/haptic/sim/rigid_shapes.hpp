// Bodies that do not deform, generated: a plate to slide on, a thin rod to catch on. The tool feels them; other bodies
// pass through them. They stand still, or go where the regions of their model lead them.
#pragma once

#include <cstdint>

#include "haptic/sim/mesh.hpp"
#include "haptic/sim/particles.hpp"

namespace haptic::sim {

struct PlateShape {
    Vec3 size{1.0, 0.05, 1.0};  // m, along x, y and z
    std::uint32_t cells = 8;    // 1 to 256, along x and z each, on both faces

    /// Throws std::invalid_argument.
    void check() const;
};

struct RodShape {
    double length = 1.0;     // m, along x
    double diameter = 0.02;  // m, of the circle about its corners

    /// Throws std::invalid_argument.
    void check() const;
};

/// Triangles of make_plate_mesh: 4 cells (cells + 2).
[[nodiscard]] std::size_t plate_triangles(const PlateShape& shape) noexcept;
/// Triangles of make_rod_mesh: two for each of its sides along it, and the two ends.
[[nodiscard]] std::size_t rod_triangles() noexcept;

/// A closed box about the origin. Upper and lower face are grids of cells of two triangles each, whose vertex (column
/// i, row j) has index j (cells + 1) + i, at x = i, z = j; those of the lower face come after those of the upper one.
/// Throws std::invalid_argument.
[[nodiscard]] TriangleMesh make_plate_mesh(const PlateShape& shape);

/// A closed prism of twelve sides about the x axis, its middle at the origin. Made with + - * / and sqrt only. Throws
/// std::invalid_argument.
[[nodiscard]] TriangleMesh make_rod_mesh(const RodShape& shape);

/// One particle for each vertex, in the same order, all pinned: the mesh keeps its shape. The mass, kg, is spread
/// evenly and matters to nothing as long as they are.
[[nodiscard]] ParticleModel make_rigid_particles(const TriangleMesh& mesh, double mass);

}  // namespace haptic::sim
