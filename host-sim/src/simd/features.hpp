// Feature kernels: pairs of features of surfaces, a vertex and a triangle or two edges, and directions that part them.
//
// A pair has four vertices, those of its first feature before those of its second. Along a unit vector n, its gap is
//
//     min over the first's vertices of n.a - max over the second's of n.b,
//
// at most the distance of the two. It is the least of sums that are linear in the vertices. So where vertices move on
// straight paths, a gap that is positive at both ends of their way is positive all the way.
#pragma once

#include <cstddef>
#include <cstdint>

#include "simd/projection.hpp"

namespace haptic::sim {

/// Also the number of the first feature's vertices.
enum class PairKind : std::uint8_t { VertexTriangle = 1, EdgeEdge = 2 };

/// Edges with a sine of their angle below this count as parallel: any of their points is as near as another.
inline constexpr double kParallelEdges = 1e-7;

/// Arrays of shape [pair].
struct FeatureRows {
    const std::uint32_t* vertex[4];
    double* normal[3];  // unit, toward the first feature; 0 if unknown
    double* gap;        // m, along the normal
};

/// Nearest points, arrays of shape [pair].
struct NearestRows {
    double* weight[4];  // of the vertices, those of the second feature negative
    double* distance;   // m
};

struct FeatureKernels {
    std::size_t lanes;
    /// Writes the normal with the wider gap of two that are quick to find, and the gap: along the line of the features'
    /// middles, or across the triangle or both edges.
    void (*find_normals)(PairKind kind, const FeatureRows& pairs, std::size_t count, const Row* position) noexcept;
    /// Writes the gaps along the normals.
    void (*find_gaps)(PairKind kind, const FeatureRows& pairs, std::size_t count, const Row* position) noexcept;
    /// Writes nearest points, the normals from the second to the first, and the gaps along them. Finite for features of
    /// any shape. A triangle without area counts as its edges; of parallel edges any nearest points are taken.
    void (*find_nearest)(PairKind kind, const FeatureRows& pairs, std::size_t count, const Row* position,
                         const NearestRows& nearest) noexcept;
};

}  // namespace haptic::sim
