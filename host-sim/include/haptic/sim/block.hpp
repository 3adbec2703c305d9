// Block generator: a rectangular solid, the specimen of which every deformation can be compared with a formula.
#pragma once

#include <cstddef>
#include <cstdint>

#include "haptic/sim/mesh.hpp"

namespace haptic::sim {

struct BlockShape {
    Vec3 size{0.12, 0.04, 0.08};  // m, along x, y and z
    std::uint32_t cells = 12;     // 1 to 256, along the longest side; the others have cells of at most that width

    /// Throws std::invalid_argument.
    void check() const;
};

/// Triangles of make_block_mesh: two per cell of each face, 704 by default.
[[nodiscard]] std::size_t block_triangles(const BlockShape& shape) noexcept;

/// A closed box about the origin, oriented outward, with a square grid on each face. Faces share the vertices of their
/// edges. Throws std::invalid_argument.
[[nodiscard]] TriangleMesh make_block_mesh(const BlockShape& shape);

}  // namespace haptic::sim
