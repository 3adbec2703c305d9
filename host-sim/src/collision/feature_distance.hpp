// Nearest points of two features of surfaces: a vertex and a triangle, or two edges.
#pragma once

#include <array>

#include "haptic/types.hpp"
#include "simd/features.hpp"

namespace haptic::sim {

/// Vertices of a pair, m, those of the first feature before those of the second.
using FeatureVertices = std::array<Vec3, 4>;

struct NearestPoints {
    /// Of the vertices, those of the second feature negative, so that their weighted sum is `apart`.
    std::array<double, 4> weight{};
    Vec3 apart{0.0};        // m, from the nearest point of the second feature to that of the first
    double distance = 0.0;  // m

    /// Unit, toward the first feature; 0 if they touch.
    [[nodiscard]] Vec3 normal() const noexcept { return distance > 0.0 ? apart / distance : Vec3(0.0); }
};

/// Finite for features of any shape, also degenerate ones.
/// @source Ericson 2005, Real-Time Collision Detection, 5.1.5 and 5.1.9
[[nodiscard]] NearestPoints nearest_points(PairKind kind, const FeatureVertices& x) noexcept;

}  // namespace haptic::sim
