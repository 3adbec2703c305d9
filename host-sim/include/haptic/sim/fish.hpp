// Fish generator, so that the built-in scenes need no mesh file.
//
// One closed surface without holes: body, open mouth, eyes, dorsal, anal, forked caudal, pectoral and pelvic fins. It
// looks along +x with its back towards +y; its halves are exact mirror images in z.
#pragma once

#include <cstdint>

#include "haptic/sim/mesh.hpp"

namespace haptic::sim {

/// Triangles of an unrefined fish, the number of the thesis' fish (section 4.4.4: four fish have 6,800). It has 852
/// vertices (closed and welded).
inline constexpr std::uint32_t kFishTriangles = 1700;

struct FishShape {
    double length = 0.3;                   // m, from the lips to the tail tips
    std::uint32_t refinements = 0;         // 0..5: each splits every triangle into four at its edge midpoints
    Vec3 centre{0.0, 0.0, 0.0};            // m, midway between lips and tail
    Quat orientation{1.0, 0.0, 0.0, 0.0};  // scene_from_fish

    /// Throws std::invalid_argument.
    void check() const;
};

/// Closed surface, consistently oriented outward; 0.39 lengths high and 0.29 wide with fins, 0.26 and 0.14 without. A
/// length of 0.3 m encloses 0.36 litres. Uses + - * / only, so its bits are the same on every machine. Throws
/// std::invalid_argument.
[[nodiscard]] TriangleMesh make_fish_mesh(const FishShape& shape);

}  // namespace haptic::sim
