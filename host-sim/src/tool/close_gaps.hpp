// Further spheres where those of a tool leave gaps (thesis, figure 5.9).
//
// The spheres' centres, the lines between neighbours and the triangles between each three of them make a net, which
// runs through the tool as its cells do. What passes between the spheres passes through the net. So there is no gap if
// every point of the net is in a sphere.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "tool/sphere_cover.hpp"

namespace haptic::sim {

using Neighbours = std::vector<std::pair<std::uint32_t, std::uint32_t>>;  // the lower one first, sorted

/// The thickness of the thickest ball that can be centred on the net without meeting a sphere, m: a thinner rod gets
/// through. 0 if there is no gap. To 1 %, or 1e-4 of the net's size.
[[nodiscard]] double widest_gap(std::span<const Ball> balls, const Neighbours& neighbours);

/// m: how large a ball about a point may be; not positive where none belongs.
using Room = std::function<double(const Vec3&)>;

/// The balls, and behind them those that it takes for the net of the first ones to be within 0.9 of all radii: it stays
/// closed while it is stretched by a tenth. Along a line between neighbours, balls are evenly apart and their radii go
/// evenly from one to the other, unless there is less room; parts of the net without room stay as they are. Throws
/// std::invalid_argument, with the number that it takes, if it is more than `most`.
[[nodiscard]] std::vector<Ball> close_gaps(std::span<const Ball> balls, const Neighbours& neighbours, std::size_t most,
                                           const Room& room);

}  // namespace haptic::sim
