// Sample graph: a body as many small samples, joined by edges that stay within the body.
//
// The model builder measures distances along these edges, so that what is close only through the air, such as two fins
// or the walls of a slit, is far apart. A closed mesh is sampled by a shell and a lattice inside it; where it is
// thinner than the shell, both sides share the middle. Any other mesh is sampled on its surface.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "haptic/sim/mesh.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

struct Edge {
    std::uint32_t to = 0;
    double length = 0.0;  // m
};

struct SampleGraph {
    std::vector<Vec3> position;           // m, per sample; those of the mesh's vertices come first, in their order
    std::vector<double> share;            // per sample, positive: m^3 of the body if the mesh is closed, else m^2
    std::vector<std::size_t> first_edge;  // [sample + 1], into edges
    std::vector<Edge> edges;              // in both directions

    [[nodiscard]] std::size_t size() const noexcept { return position.size(); }
    [[nodiscard]] std::span<const Edge> edges_from(std::size_t sample) const {
        return std::span(edges).subspan(first_edge[sample], first_edge[sample + 1] - first_edge[sample]);
    }
};

/// Samples a body at distances of about `pitch`, m. Parts of the mesh that share no vertex are joined where samples of
/// both are within `bridge`, m; throws std::invalid_argument with the distance if a part remains. Preconditions: all
/// indices exist, every vertex is finite and belongs to a triangle, some triangle has an area.
[[nodiscard]] SampleGraph make_sample_graph(const TriangleMesh& mesh, double pitch, double bridge);

}  // namespace haptic::sim
