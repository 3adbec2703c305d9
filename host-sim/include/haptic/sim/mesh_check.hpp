// Mesh check: turns triangles from any source into a surface that can be simulated. It merges vertices that were split
// at seams, removes elements without function, orients faces consistently, and names everything unusual in warnings.
//
// It refuses what the simulation cannot handle: coordinates that are not finite, indices out of range, meshes without
// area, and too many elements. Contact is two-sided and needs no connectivity, so an open or double-faced sheet, an
// edge with five triangles or a Möbius strip can be simulated. The user is warned, because a solid that should be
// closed and is not has no inside.
#pragma once

#include <cstddef>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "haptic/sim/mesh.hpp"

namespace haptic::sim {

/// what() starts with the name of the mesh, names the wrong element and says what would be right.
class MeshError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

struct MeshCheckSettings {
    static constexpr double kMaxWeldTolerance = 0.01;

    /// Distance within which vertices are merged, as a fraction of the bounding box's diagonal, 0 to 0.01; 0 merges
    /// equal ones only. The default is about ten roundings of a 32-bit coordinate, as files have them.
    double weld_tolerance = 1e-6;
    std::size_t max_vertices = 6'000'000;   // before merging: STL has three per triangle
    std::size_t max_triangles = 2'000'000;  // 1 to 100 million

    /// Throws std::invalid_argument.
    void check() const;
};

/// Findings and changes. "Given" elements are those of the input, counted from 0.
struct MeshReport {
    std::size_t vertices_given = 0;
    std::size_t triangles_given = 0;
    std::size_t vertices = 0;
    std::size_t triangles = 0;

    std::size_t welded = 0;      // vertices merged into another
    std::size_t unused = 0;      // vertices removed: no triangle uses them
    std::size_t collapsed = 0;   // triangles removed: two corners are the same vertex
    std::size_t duplicates = 0;  // triangles removed: same corners and winding as an earlier one
    std::size_t flipped = 0;     // triangles reversed to agree with their neighbours
    bool turned = false;         // the mesh was inside out and has been reversed

    std::size_t degenerate = 0;        // triangles kept with (nearly) collinear corners
    std::size_t double_faced = 0;      // pairs of triangles with the same corners and opposite winding
    std::size_t boundary_edges = 0;    // edges of one triangle
    std::size_t crowded_edges = 0;     // edges of more than two triangles; a double-faced pair counts as one
    std::size_t pinched_vertices = 0;  // vertices that join several fans without a common edge
    std::size_t crossings = 0;         // edges that pierce a triangle with which they share no vertex
    bool crossings_known = true;       // false: so many triangles overlap that the search was given up
    std::size_t components = 0;        // connected parts; different parts share no vertex
    bool orientable = true;            // a consistent orientation exists
    bool closed = false;               // encloses a volume

    Vec3 low{0.0};        // m, bounding box
    Vec3 high{0.0};       // m
    double area = 0.0;    // m^2, of all triangles, both faces of a pair
    double volume = 0.0;  // m^3; 0 unless closed

    std::vector<std::string> warnings;  // one sentence each, naming the first given element concerned
};

struct CheckedMesh {
    TriangleMesh mesh;
    MeshReport report;
};

/// Welds, checks and orients. Remaining elements keep their order; a merged vertex has the position of the first one.
/// Deterministic to the bit. O(n log n). `name` names the mesh in messages. Throws MeshError, and std::invalid_argument
/// for settings out of range.
[[nodiscard]] CheckedMesh check_mesh(std::span<const Vec3> vertices, std::span<const Triangle> triangles,
                                     const MeshCheckSettings& settings, const std::string& name);

/// Maps each vertex to the first kept vertex within `tolerance`, m; kept vertices map to themselves. Kept vertices are
/// farther apart than the tolerance. All coordinates must be finite.
[[nodiscard]] std::vector<std::uint32_t> weld(std::span<const Vec3> vertices, double tolerance);

}  // namespace haptic::sim
