// A fish, generated: the built-in scenes need no mesh file.
//
// One closed skin without holes: body, open mouth, eyes, dorsal, anal, forked caudal, pectoral and pelvic fins. It
// looks along +x, its back is toward +y, and its halves are mirror images of one another in z, to the last bit.
#pragma once

#include <cstdint>

#include "haptic/sim/mesh.hpp"

namespace haptic::sim {

/// Triangles of a fish that is not refined, as many as that of the thesis has (section 4.4.4: 6,800 of four). Closed
/// and welded, it has 852 vertices.
inline constexpr std::uint32_t kFishTriangles = 1700;

struct FishShape {
    double length = 0.3;                   // m, from the lips to the tips of the tail
    std::uint32_t refinements = 0;         // 0..5: each cuts every triangle into four at the middles of its edges
    Vec3 centre{0.0, 0.0, 0.0};            // m, half way between lips and tail
    Quat orientation{1.0, 0.0, 0.0, 0.0};  // scene_from_fish

    /// Throws std::invalid_argument.
    void check() const;
};

/// The skin: closed, every edge with two triangles that agree about its direction, outward oriented, 0.39 lengths
/// high and 0.29 wide over all fins, 0.26 and 0.14 without. A length of 0.3 m makes 0.36 litres. Made with + - * /
/// only, so that its bits are the same on every machine. Throws std::invalid_argument.
[[nodiscard]] TriangleMesh make_fish_mesh(const FishShape& shape);

}  // namespace haptic::sim
