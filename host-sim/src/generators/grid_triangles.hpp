// Triangles of a rectangular grid of vertices.
#pragma once

#include <cstdint>
#include <vector>

#include "haptic/sim/mesh.hpp"

namespace haptic::sim {

/// Two for each cell; diagonals alternate, so that the grid prefers neither direction. Vertices are numbered row by
/// row. Counter-clockwise seen from +y if columns follow one another along +x and rows along +z.
[[nodiscard]] inline std::vector<Triangle> grid_triangles(std::uint32_t columns, std::uint32_t rows) {
    std::vector<Triangle> triangles;
    for (std::uint32_t j = 0; j + 1 < rows; ++j) {
        for (std::uint32_t i = 0; i + 1 < columns; ++i) {
            // Corners of the cell: a b in one row, c d in the next.
            const std::uint32_t a = j * columns + i;
            const std::uint32_t b = a + 1;
            const std::uint32_t c = a + columns;
            const std::uint32_t d = c + 1;
            if ((i + j) % 2 == 0) {
                triangles.insert(triangles.end(), {{a, c, d}, {a, d, b}});
            } else {
                triangles.insert(triangles.end(), {{a, c, b}, {b, c, d}});
            }
        }
    }
    return triangles;
}

}  // namespace haptic::sim
