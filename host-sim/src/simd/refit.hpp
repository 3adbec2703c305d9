// The inner loop of SweptTree::refit, for registers of different width.
//
// A vertex is read as four numbers, x, y, z and the x of the next; what comes of the fourth is not used. Least and
// greatest are what they are whatever the width, so the bits are the same.
#pragma once

#include <cstddef>
#include <cstdint>

#include <haptic/sim/contact/tree_leaves.hpp>

namespace haptic::sim {

/// Shapes as indicated; at least one vertex.
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

void refit_baseline(const RefitTask& task) noexcept;
#if defined(__x86_64__)
void refit_avx2(const RefitTask& task) noexcept;
#endif

}  // namespace haptic::sim
