// What makes triangles from anywhere a surface that can be simulated: vertices that were split at seams are merged,
// what carries nothing is left out, faces are made to look to one side, and everything that is odd is said by name.
//
// Refused is what the simulation cannot handle: numbers that are none, indices out of range, no triangle with an area,
// too much of it. Contact is two-sided and needs no neighbourhood, so a sheet, a double-faced sheet, an edge with five
// triangles or a Möbius strip are all simulated; but the user is told, because a solid that was meant closed and is not
// has no inside.
#pragma once

#include <cstddef>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "haptic/sim/mesh.hpp"

namespace haptic::sim {

/// what() begins with the name of the mesh, names the element that is wrong, and says what would be right.
class MeshError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

struct MeshCheckSettings {
    /// Vertices no farther apart than this part of the diagonal of the mesh's box are one; 0 merges equal ones only.
    /// 0 to 0.01. The default is some ten roundings of a coordinate with the 32 bits that files have.
    double weld_tolerance = 1e-6;
    std::size_t most_vertices = 6'000'000;   // as they come: STL has three for each triangle
    std::size_t most_triangles = 2'000'000;  // 1 to 100 million

    /// Throws std::invalid_argument.
    void check() const;
};

/// What was found, and what was done about it. "As given" is before anything was done; elements count from 0 there.
struct MeshReport {
    std::size_t vertices_given = 0;
    std::size_t triangles_given = 0;
    std::size_t vertices = 0;
    std::size_t triangles = 0;

    std::size_t welded = 0;      // vertices merged into another at their place
    std::size_t unused = 0;      // vertices left out: no triangle has them
    std::size_t collapsed = 0;   // triangles left out: two of their corners are one vertex
    std::size_t duplicates = 0;  // triangles left out: the same corners in the same sense as one before
    std::size_t flipped = 0;     // triangles turned over to look where their neighbours do
    bool turned = false;         // the whole was inside out, and is not any more

    std::size_t degenerate = 0;        // triangles kept that have no height: their corners are on a line
    std::size_t double_faced = 0;      // pairs of triangles with the same corners that look to opposite sides
    std::size_t boundary_edges = 0;    // of one triangle
    std::size_t crowded_edges = 0;     // of more than two triangles, a pair of a double-faced sheet counting as one
    std::size_t pinched_vertices = 0;  // their triangles make several fans that touch in this vertex only
    std::size_t components = 0;        // parts that share no vertex
    bool orientable = true;            // all neighbours agree about their side
    bool closed = false;               // encloses a volume

    Vec3 low{0.0};        // m, of the box
    Vec3 high{0.0};       // m
    double area = 0.0;    // m^2, of all triangles, both of a pair counting
    double volume = 0.0;  // m^3; 0 unless closed

    std::vector<std::string> warnings;  // a sentence each; the first element concerned is named, as it was given
};

struct CheckedMesh {
    TriangleMesh mesh;
    MeshReport report;
};

/// Welds, checks and orients. The order of what is left is that of what was given; a merged vertex is where the first
/// of those merged was. Same input, same bits. O(n log n). `name` stands for the mesh in messages. Throws MeshError,
/// and std::invalid_argument for settings out of range.
[[nodiscard]] CheckedMesh check_mesh(std::span<const Vec3> vertices, std::span<const Triangle> triangles,
                                     const MeshCheckSettings& settings, const std::string& name);

/// For each vertex the first one that is no farther than `tolerance` (m) and is kept itself; its own index if it is
/// kept. Distances between kept vertices are greater than the tolerance. All coordinates finite.
[[nodiscard]] std::vector<std::uint32_t> weld(std::span<const Vec3> vertices, double tolerance);

}  // namespace haptic::sim
