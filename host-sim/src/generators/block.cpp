#include "haptic/sim/block.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace haptic::sim {
namespace {

constexpr std::uint32_t kMaxBlockCells = 256;

using CellCounts = std::array<std::uint32_t, 3>;  // along x, y and z

CellCounts cells_along(const BlockShape& shape) {
    const double cell = std::max({shape.size.x, shape.size.y, shape.size.z}) / shape.cells;
    CellCounts count{};
    for (std::size_t k = 0; k < 3; ++k) {
        // A multiple of the cell's width stays one despite its rounding.
        const double wanted = std::ceil(shape.size[static_cast<int>(k)] / cell - 1e-6);
        count[k] = static_cast<std::uint32_t>(std::clamp(wanted, 1.0, static_cast<double>(shape.cells)));
    }
    return count;
}

/// The lattice points on the surface, numbered layer by layer in y: the lowest and the highest layer are full grids,
/// those between them are rings.
class SurfaceLattice {
  public:
    using Point = std::array<std::uint32_t, 3>;

    explicit SurfaceLattice(const CellCounts& cells)
        : cells_(cells), full_((cells[0] + 1) * (cells[2] + 1)), ring_(2 * (cells[0] + cells[2])) {}

    [[nodiscard]] std::uint32_t index(const Point& p) const {
        const auto& [i, j, k] = p;
        const auto [nx, ny, nz] = cells_;
        if (j == 0 || j == ny) {
            return (j == 0 ? 0 : full_ + (ny - 1) * ring_) + k * (nx + 1) + i;
        }
        // Once around: along +x at the first z, along +z at the last x, and back.
        std::uint32_t along = 2 * nx + nz + (nz - k);
        if (k == 0) {
            along = i;
        } else if (i == nx) {
            along = nx + k;
        } else if (k == nz) {
            along = nx + nz + (nx - i);
        }
        return full_ + (j - 1) * ring_ + along;
    }

    [[nodiscard]] std::size_t size() const { return 2 * std::size_t{full_} + (cells_[1] - 1) * std::size_t{ring_}; }

  private:
    CellCounts cells_;
    std::uint32_t full_;  // points of a full layer
    std::uint32_t ring_;  // points of a ring
};

/// Adds the face at the low or high end of an axis. `vertex` gives the index of a lattice point.
template <typename Vertex>
void add_face(const CellCounts& cells, std::size_t axis, bool high, Vertex vertex, std::vector<Triangle>& triangles) {
    const std::size_t u = (axis + 1) % 3;
    const std::size_t v = (axis + 2) % 3;
    for (std::uint32_t row = 0; row < cells[v]; ++row) {
        for (std::uint32_t column = 0; column < cells[u]; ++column) {
            // Corners of the cell, counter-clockwise seen from the axis' positive end.
            std::array<std::uint32_t, 4> corner{};
            for (std::size_t c = 0; c < 4; ++c) {
                SurfaceLattice::Point p{};
                p[axis] = high ? cells[axis] : 0;
                p[u] = column + (c == 1 || c == 2 ? 1 : 0);
                p[v] = row + (c >= 2 ? 1 : 0);
                corner[c] = vertex(p);
            }
            if (!high) {
                std::swap(corner[1], corner[3]);
            }
            // Diagonals alternate, so that the mesh has no preferred direction.
            if ((row + column) % 2 == 1) {
                std::rotate(corner.begin(), corner.begin() + 1, corner.end());
            }
            triangles.push_back({corner[0], corner[1], corner[2]});
            triangles.push_back({corner[0], corner[2], corner[3]});
        }
    }
}

}  // namespace

void BlockShape::check() const {
    if (cells < 1 || cells > kMaxBlockCells) {
        throw std::invalid_argument("block: cells must be 1 to " + std::to_string(kMaxBlockCells));
    }
    for (int k = 0; k < 3; ++k) {
        if (!(size[k] > 0.0) || !std::isfinite(size[k])) {
            throw std::invalid_argument("block: each size must be positive");
        }
    }
}

std::size_t block_triangles(const BlockShape& shape) noexcept {
    const auto [nx, ny, nz] = cells_along(shape);
    return 4 * (std::size_t{nx} * ny + std::size_t{ny} * nz + std::size_t{nz} * nx);
}

TriangleMesh make_block_mesh(const BlockShape& shape) {
    shape.check();
    const CellCounts cells = cells_along(shape);
    const SurfaceLattice lattice(cells);
    TriangleMesh mesh;
    mesh.closed = true;
    mesh.vertices.resize(lattice.size());
    mesh.triangles.reserve(block_triangles(shape));
    const auto vertex = [&](const SurfaceLattice::Point& p) {
        const std::uint32_t at = lattice.index(p);
        for (std::size_t k = 0; k < 3; ++k) {
            const int axis = static_cast<int>(k);
            mesh.vertices[at][axis] = shape.size[axis] * (static_cast<double>(p[k]) / cells[k] - 0.5);
        }
        return at;
    };
    for (std::size_t axis = 0; axis < 3; ++axis) {
        for (const bool high : {false, true}) {
            add_face(cells, axis, high, vertex, mesh.triangles);
        }
    }
    return mesh;
}

}  // namespace haptic::sim
