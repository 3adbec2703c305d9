// A body cut into many small pieces, and the ways between them that stay within it.
//
// The builder of particle models measures along these ways, so that what is near through the air only, two fins or two
// walls of a slit, is far apart. A closed mesh is cut into a shell and a lattice inside; where it is thinner than the
// shell, both its sides share the middle. Any other mesh is cut along its surface.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <haptic/sim/mesh.hpp>
#include <haptic/types.hpp>

namespace haptic::sim {

struct Way {
    std::uint32_t to = 0;
    double length = 0.0;  // m
};

struct SampleGraph {
    std::vector<Vec3> position;  // m, of each piece; those of the mesh's vertices come first, in their order
    std::vector<double> share;  // of the body that each piece stands for: m^3 if the mesh is closed, else m^2; positive
    std::vector<std::size_t> first_way;  // per piece and one more
    std::vector<Way> ways;               // in both directions

    [[nodiscard]] std::size_t size() const noexcept { return position.size(); }
    [[nodiscard]] std::span<const Way> ways_from(std::size_t piece) const {
        return std::span(ways).subspan(first_way[piece], first_way[piece + 1] - first_way[piece]);
    }
};

/// Cuts a body into pieces about `pitch` apart (m). Parts of the mesh that share no vertex are joined if pieces of both
/// come as near as `bridge` (m); throws std::invalid_argument, saying how far away it is, if a part is then left over.
/// Every triangle's indices exist, every vertex is finite and belongs to a triangle, some triangle has an area.
[[nodiscard]] SampleGraph make_sample_graph(const TriangleMesh& mesh, double pitch, double bridge);

/// Volume that a closed mesh encloses, m^3; negative if its triangles look inward.
[[nodiscard]] double signed_volume(const TriangleMesh& mesh);
/// m^2
[[nodiscard]] double surface_area(const TriangleMesh& mesh);

}  // namespace haptic::sim
