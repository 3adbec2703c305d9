#include "mesh/refinement.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/geometric.hpp>
#include <unordered_map>
#include <utility>
#include <vector>

namespace haptic::sim {
namespace {

std::uint64_t key_of_midpoint(std::uint32_t a, std::uint32_t b) {
    return (std::uint64_t{std::min(a, b)} << 32U) | std::max(a, b);
}

class Refinement {
  public:
    Refinement(const TriangleMesh& mesh, double max_edge) : mesh_(mesh), max_edge_(max_edge) {}

    [[nodiscard]] TriangleMesh& mesh() noexcept { return mesh_; }

    /// Halves all long edges; returns whether there were any. Triangles find their shared midpoints by the edge's key.
    bool split() {
        std::unordered_map<std::uint64_t, std::uint32_t> midpoints;
        std::vector<Triangle> smaller;
        smaller.reserve(mesh_.triangles.size());
        const std::size_t before = mesh_.vertices.size();
        for (const Triangle& t : mesh_.triangles) {
            split(t, midpoints, smaller);
        }
        mesh_.triangles.swap(smaller);
        return mesh_.vertices.size() > before;
    }

  private:
    void split(const Triangle& t, std::unordered_map<std::uint64_t, std::uint32_t>& midpoints,
               std::vector<Triangle>& out) {
        // Edges to be halved.
        std::array<bool, 3> long_edge{};  // from corner k to the next
        std::size_t cuts = 0;
        std::size_t first = 0;
        for (std::size_t k = 0; k < 3; ++k) {
            long_edge[k] = glm::length(mesh_.vertices[t[(k + 1) % 3]] - mesh_.vertices[t[k]]) > max_edge_;
            cuts += long_edge[k] ? std::size_t{1} : 0;
        }
        if (cuts == 0) {
            out.push_back(t);
            return;
        }
        // Rotate the corners so that the first edge is split and, of two split edges, the last is not.
        while (!long_edge[first] || (cuts == 2 && long_edge[(first + 2) % 3])) {
            ++first;
        }
        const std::uint32_t a = t[first];
        const std::uint32_t b = t[(first + 1) % 3];
        const std::uint32_t c = t[(first + 2) % 3];
        const std::uint32_t ab = midpoint(a, b, midpoints);
        // One edge: two triangles.
        if (cuts == 1) {
            out.insert(out.end(), {{a, ab, c}, {ab, b, c}});
            return;
        }
        // Two edges: a corner and a quadrilateral, which is cut in two.
        const std::uint32_t bc = midpoint(b, c, midpoints);
        if (cuts == 2) {
            out.insert(out.end(), {{ab, b, bc}, {a, ab, bc}, {a, bc, c}});
            return;
        }
        // Three edges: four similar triangles.
        const std::uint32_t ca = midpoint(c, a, midpoints);
        out.insert(out.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }

    std::uint32_t midpoint(std::uint32_t a, std::uint32_t b,
                           std::unordered_map<std::uint64_t, std::uint32_t>& midpoints) {
        const auto [entry, is_new] =
            midpoints.try_emplace(key_of_midpoint(a, b), static_cast<std::uint32_t>(mesh_.vertices.size()));
        if (is_new) {
            const Vec3 between = 0.5 * (mesh_.vertices[std::min(a, b)] + mesh_.vertices[std::max(a, b)]);
            mesh_.vertices.push_back(between);
        }
        return entry->second;
    }

    TriangleMesh mesh_;
    double max_edge_;
};

}  // namespace

TriangleMesh refined(const TriangleMesh& mesh, double max_edge, std::size_t max_vertices) {
    Refinement refinement(mesh, max_edge);
    while (refinement.split() && refinement.mesh().vertices.size() <= max_vertices) {
    }
    return std::move(refinement.mesh());
}

}  // namespace haptic::sim
