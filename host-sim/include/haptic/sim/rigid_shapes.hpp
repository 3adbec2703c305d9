// Rigid shape generators: a plate to slide on, and a thin rod. The tool feels them; other bodies pass through them.
// They stay at rest unless the regions of their model move them.
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
    double diameter = 0.02;  // m, of the circumscribed circle

    /// Throws std::invalid_argument.
    void check() const;
};

/// Triangles of make_plate_mesh: 4 cells (cells + 2).
[[nodiscard]] std::size_t plate_triangles(const PlateShape& shape) noexcept;
/// Triangles of make_rod_mesh: two per side, and the two end caps.
[[nodiscard]] std::size_t rod_triangles() noexcept;

/// A closed box about the origin. Upper and lower face are grids with two triangles per cell. Vertex (column i, row j)
/// of the upper face has index j (cells + 1) + i, at x = i, z = j; the lower face follows in the same order. Throws
/// std::invalid_argument.
[[nodiscard]] TriangleMesh make_plate_mesh(const PlateShape& shape);

/// A closed twelve-sided prism about the x axis, centred at the origin. Uses + - * / and sqrt only. Throws
/// std::invalid_argument.
[[nodiscard]] TriangleMesh make_rod_mesh(const RodShape& shape);

/// One pinned particle per vertex, in the same order, so that the mesh keeps its shape. Each has the same part of
/// `mass`, kg, which has no effect while all are pinned.
[[nodiscard]] ParticleModel make_rigid_particles(const TriangleMesh& mesh, double mass);

}  // namespace haptic::sim
