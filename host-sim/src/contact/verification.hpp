// Verification: did the proxy's centre cross any surface? Answered without the contact code.
//
// This file and its source share no function with the contact code. They have their own cubic and their own inside
// test, and they check every triangle in each step, without a tree. The proxy is judged by the path that it recorded.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "contact/proxy_path.hpp"
#include "haptic/sim/mesh.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// A crossing of the proxy's path through a triangle.
struct Crossing {
    std::uint32_t object = 0;
    std::uint32_t triangle = 0;
    std::uint32_t piece = 0;  // between knot `piece` and the next
    double time = 0.0;        // of the step, in [0, 1]
    Vec3 position{0.0};       // m, of the centre at that time
};

/// Finds every crossing of a path with surfaces that move linearly from start to end over the step, ordered by surface,
/// piece and triangle. The second face of a double-faced triangle (the same three vertices) is the same surface and is
/// not reported again. Passing around a border is no crossing. Brute force, pieces x triangles, with a box test first.
/// Allocates.
[[nodiscard]] std::vector<Crossing> find_crossings(std::span<const SurfaceMotion> surfaces,
                                                   std::span<const PathKnot> path);

/// Same for several paths; each result is bit-identical. Each triangle's box over the whole step is computed once and
/// tested against the box of all paths, then of each path; only the rest is tested against the pieces.
[[nodiscard]] std::vector<std::vector<Crossing>> find_crossings(std::span<const SurfaceMotion> surfaces,
                                                                std::span<const std::span<const PathKnot>> paths);

/// Winding number of a closed surface around a point: 1 inside, 0 outside, for faces counter-clockwise seen from
/// outside.
/// @source Van Oosterom, Strackee 1983 (solid angle of a triangle)
[[nodiscard]] double winding_number(std::span<const Vec3> vertices, std::span<const Triangle> triangles,
                                    const Vec3& point);

}  // namespace haptic::sim
