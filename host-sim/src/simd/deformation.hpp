// Deformation kernels: the affine map that leads points from a reference to where they are, and what it leaves of each.
//
// Points lie in groups of sixteen, whatever the width of a register, and sums are added up in the same order for every
// width, so the bits are the same.
#pragma once

#include <cstddef>
#include <cstdint>

#include "simd/projection.hpp"

namespace haptic::sim {

inline constexpr std::size_t kPointsInGroup = 16;

/// As many points of a reference, in little memory.
struct alignas(64) PointGroup {
    std::int16_t number[3][kPointsInGroup];  // x, y, z in units of the reference
    std::int16_t distance[kPointsInGroup];   // from something, in the same unit
    std::uint32_t point[kPointsInGroup];     // number of the point among places
};

/// Places of as many points, x, y, z, m.
struct alignas(64) GroupPlaces {
    float number[3][kPointsInGroup];
};

/// Leads (x, y, z) to origin + x column[0] + y column[1] + z column[2].
struct AffineMap {
    float column[3][3];  // m by the unit of the reference
    float origin[3];     // m
};

/// Some groups of points. The first ones, at least one, are told apart; a map is fitted to these and some more.
struct DeformationTask {
    const PointGroup* group;  // [groups]
    std::size_t groups;
    std::size_t first_groups;
    std::size_t fitted_groups;
};

/// Over the points to which a map is fitted.
struct DeformationSums {
    float product[3][3];  // [k][axis] of number k in the reference and the place along an axis, m
    float place[3];       // m
};

/// Of numbers; others are left out.
struct ResidualExtremes {
    float of_first;  // m, the most of the first groups
    float of_near;   // m, the most of points whose distance is at most a limit
    float left;      // m, the least that residuals leave of stretched distances
};

/// `places`: x, y, z of all points, m.
struct DeformationKernels {
    std::size_t lanes;
    /// Also writes the places of every group.
    void (*sum)(const DeformationTask& task, const FloatRow* places, GroupPlaces* of_groups,
                DeformationSums& sums) noexcept;
    /// Writes how far each point is from where its map leads it, m, at the start or at the end, whichever is more, of
    /// shape [groups][kPointsInGroup]. `stretch`: m by the unit of the reference; `limit`: in that unit.
    ResidualExtremes (*find_residuals)(const DeformationTask& task, const AffineMap& start_map, const FloatRow* start,
                                       const AffineMap& end_map, const GroupPlaces* end, float stretch, float limit,
                                       float* residual) noexcept;
};

}  // namespace haptic::sim
