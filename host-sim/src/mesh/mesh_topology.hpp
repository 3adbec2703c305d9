// Mesh connectivity: edges, connected parts, fans about vertices, orientation.
#pragma once

#include <cstdint>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "haptic/sim/mesh.hpp"

namespace haptic::sim::detail {

/// Disjoint sets (union-find), represented by their smallest member.
class DisjointSets {
  public:
    explicit DisjointSets(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0U); }

    [[nodiscard]] std::uint32_t find(std::uint32_t i) {
        while (parent_[i] != i) {
            parent_[i] = parent_[parent_[i]];
            i = parent_[i];
        }
        return i;
    }

    void unite(std::uint32_t i, std::uint32_t j) {
        i = find(i);
        j = find(j);
        parent_[i < j ? j : i] = i < j ? i : j;
    }

  private:
    std::vector<std::uint32_t> parent_;
};

/// One side of a triangle: a directed edge.
struct Side {
    std::uint32_t low = 0;  // smaller vertex index
    std::uint32_t high = 0;
    std::uint32_t triangle = 0;
    bool forward = false;  // from low to high
};

/// Sides of the triangles whose `counts` is not 0, sorted by edge, then by triangle.
[[nodiscard]] std::vector<Side> sorted_sides(std::span<const Triangle> triangles, std::span<const std::uint8_t> counts);

/// Calls `visit` with the sides of each edge, in the order of sorted_sides.
template <typename Visitor>
void for_each_edge(std::span<const Side> sides, Visitor visit) {
    for (std::size_t first = 0; first < sides.size();) {
        std::size_t end = first + 1;
        while (end < sides.size() && sides[end].low == sides[first].low && sides[end].high == sides[first].high) {
            ++end;
        }
        visit(sides.subspan(first, end - first));
        first = end;
    }
}

struct Orientation {
    std::vector<std::uint8_t> flip;  // 1: the triangle must be reversed to agree with its neighbours
    bool orientable = true;
};

/// Orients neighbours across edges of two triangles consistently. Reverses the smaller half of each part; of two equal
/// halves the one without the part's first triangle.
[[nodiscard]] Orientation orient(std::size_t triangles, std::span<const Side> sides);

struct Fans {
    std::size_t pinched = 0;  // vertices with more than one fan of triangles
    std::uint32_t first = 0;  // such vertex
};

[[nodiscard]] Fans count_fans(std::span<const Triangle> triangles, std::span<const std::uint8_t> counts,
                              std::span<const Side> sides, std::size_t vertices);

/// Number of parts that share no vertex. Every vertex must belong to a triangle.
[[nodiscard]] std::size_t count_parts(std::span<const Triangle> triangles, std::size_t vertices);

/// Adds the vertices and triangles of another mesh as parts of their own.
void append(TriangleMesh& mesh, const TriangleMesh& added);

/// Whether a surface is a sphere: closed, of one piece and without handles, its triangles alike in orientation.
[[nodiscard]] bool is_sphere(std::span<const Triangle> triangles, std::size_t vertices);

}  // namespace haptic::sim::detail
