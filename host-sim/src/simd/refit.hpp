// Refit kernel: the inner loop of SweptTree::refit, for registers of different width.
//
// A vertex is read as four numbers: x, y, z and the x of the next vertex, whose results are ignored. Minimum and
// maximum do not depend on the width, so the bits are the same.
#pragma once

#include <cstddef>
#include <cstdint>

namespace haptic::sim {

/// The vertices of a leaf in the list of all leaves' vertices: [begin, shared) occur in no earlier leaf, [shared, end)
/// do.
struct LeafVertices {
    std::uint32_t begin = 0;
    std::uint32_t shared = 0;
    std::uint32_t end = 0;
    std::uint32_t last = 0;  // 1: one of them is the last vertex of the surface; nothing may be read beyond it
};

/// Bounds of some points, [x, y, z, unused].
struct PointExtremes {
    alignas(32) double low[4];
    alignas(32) double high[4];
};

/// Input and output of one refit; at least one vertex.
struct RefitTask {
    const double* start;  // [vertex][x, y, z]
    const double* end;    // of the same shape
    std::size_t vertices;
    const std::uint32_t* order;  // of the vertices, leaf by leaf
    const LeafVertices* leaf;
    std::size_t leaves;
    PointExtremes* box;           // out, per leaf
    PointExtremes* displacement;  // out, of all vertices
};

using RefitFunction = void (*)(const RefitTask&) noexcept;

}  // namespace haptic::sim
