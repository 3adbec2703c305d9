// What a swept tree keeps of its leaves for the refit. Types only: code for registers that not every machine has
// includes this, and must bring no function of its own.
#pragma once

#include <cstdint>

namespace haptic::sim {

/// The vertices of a leaf in a list of all leaves' vertices: first those that no leaf before has, then the others.
struct LeafVertices {
    std::uint32_t begin = 0;
    std::uint32_t shared = 0;
    std::uint32_t end = 0;
    std::uint32_t last = 0;  // 1: one of them is the last vertex of the surface, behind which nothing may be read
};

/// Least and greatest numbers of some points, [x, y, z, unused].
struct PointExtremes {
    alignas(32) double low[4];
    alignas(32) double high[4];
};

}  // namespace haptic::sim
