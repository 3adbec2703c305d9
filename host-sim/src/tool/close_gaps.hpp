// Gap closing: adds spheres where those of a tool leave gaps (thesis, figure 5.9).
//
// Sphere centres, the segments between neighbours, and the triangles between three mutual neighbours form a net through
// the tool. An object that passes between the spheres passes through the net, so there is no gap if every point of the
// net is inside a sphere.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "tool/sphere_cover.hpp"

namespace haptic::sim {

using Neighbours = std::vector<std::pair<std::uint32_t, std::uint32_t>>;  // lower index first, sorted

/// Diameter of the largest ball centred on the net that meets no sphere, m; 0 without a gap. A thinner rod passes
/// through. Accurate to 1 %, or 1e-4 of the net's size.
[[nodiscard]] double widest_gap(std::span<const Ball> balls, const Neighbours& neighbours);

/// m: largest radius allowed for a ball about a point; not positive where no ball may be.
using RadiusLimit = std::function<double(const Vec3&)>;

/// Returns `balls` followed by those added to cover their net with 0.9 of all radii, so that it stays closed when the
/// tool is stretched by a tenth. Added balls are evenly spaced between two neighbours, their radii interpolated,
/// subject to `limit`; parts of the net where no ball may be stay uncovered. Throws std::invalid_argument with the
/// number needed if it exceeds `max_count`.
[[nodiscard]] std::vector<Ball> close_gaps(std::span<const Ball> balls, const Neighbours& neighbours,
                                           std::size_t max_count, const RadiusLimit& limit);

}  // namespace haptic::sim
