// Did the proxy's centre pass through anything? Answered without the contact code.
//
// This file and its source share no function with the contact code: their own cubic, their own inside test, every
// triangle looked at in each step, no tree. They judge the proxy by the path that it says it took.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "contact/proxy_path.hpp"
#include <haptic/sim/mesh.hpp>
#include <haptic/types.hpp>

namespace haptic::sim {

/// The centre passed through a triangle.
struct Crossing {
    std::uint32_t object = 0;
    std::uint32_t triangle = 0;
    std::uint32_t piece = 0;  // from knot `piece` to the next
    double time = 0.0;        // of the step
    Vec3 position{0.0};       // m, of the centre then
};

/// Every crossing of a path with surfaces that move from start to end over the step, by surface, piece and triangle.
/// The second face of a double-faced triangle (the same three vertices) is the same surface and is not reported again.
/// Passing round a border crosses nothing. Brute force: pieces x triangles; a piece is first held against each
/// triangle's box.
[[nodiscard]] std::vector<Crossing> find_crossings(std::span<const SurfaceMotion> surfaces,
                                                   std::span<const PathKnot> path);

/// The same of each of several paths, to the bit. Each triangle's box over the whole step is made once for all, and
/// held first against the box of all paths, then against that of each; only what remains is held against pieces.
[[nodiscard]] std::vector<std::vector<Crossing>> find_crossings(std::span<const SurfaceMotion> surfaces,
                                                                std::span<const std::span<const PathKnot>> paths);

/// How often a closed surface winds round a point: 1 inside, 0 outside, for faces counter-clockwise seen from outside.
/// @source Van Oosterom, Strackee 1983 (solid angle of a triangle)
[[nodiscard]] double winding_number(std::span<const Vec3> vertices, std::span<const Triangle> triangles,
                                    const Vec3& point);

}  // namespace haptic::sim
