// Refit kernel: the loops of SweptTree::refit, for registers of different width.
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

inline constexpr std::size_t kTreeWidth = 8;
/// Children with this bit are leaves.
inline constexpr std::uint32_t kLeafChild = 0x80000000u;

/// Node of a tree with the boxes of its children over the step, m.
struct SweptNode {
    double low[3][kTreeWidth];         // [axis][child]
    double minus_high[3][kTreeWidth];  // negated, so that both bounds are compared alike
    std::uint32_t child[kTreeWidth];   // node, or leaf | kLeafChild; 0: none, with an infinite box
};

/// Input and output of one refit; at least one vertex.
struct RefitTask {
    const double* start;  // [vertex][x, y, z]
    const double* end;    // of the same shape
    std::size_t vertices;
    const std::uint32_t* order;  // of the vertices, leaf by leaf
    const LeafVertices* leaf;
    std::size_t leaves;
    PointExtremes* box;  // out, per leaf
    SweptNode* node;     // children follow their parents; boxes are out
    std::size_t nodes;
    PointExtremes* node_box;      // out, per node
    PointExtremes* displacement;  // out, of all vertices
};

using RefitFunction = void (*)(const RefitTask&) noexcept;

}  // namespace haptic::sim
