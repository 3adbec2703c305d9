// Triangle meshes: vertices that move, triangles that do not change.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "haptic/types.hpp"

namespace haptic::sim {

/// Indices of three vertices, counter-clockwise seen from outside.
using Triangle = std::array<std::uint32_t, 3>;

struct TriangleMesh {
    std::vector<Vec3> vertices;  // m
    std::vector<Triangle> triangles;
    bool closed = false;  // encloses a volume; the winding number distinguishes inside and outside
    /// The second half of the triangles repeats the first with reversed winding.
    bool double_faced = false;
};

/// A surface over one simulation step, for the contact code: every vertex moves linearly from start to end. The spans
/// have the same length; triangles index into them.
struct SurfaceMotion {
    std::span<const Vec3> start;  // m, at t = 0
    std::span<const Vec3> end;    // m, at t = 1
    std::span<const Triangle> triangles;
};

}  // namespace haptic::sim
