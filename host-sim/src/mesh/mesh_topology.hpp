// How triangles hang together: edges, parts, fans, sides.
#pragma once

#include <cstdint>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include <haptic/sim/mesh.hpp>

namespace haptic::sim::detail {

/// Disjoint sets; the smallest member of a set stands for it.
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

/// A side of a triangle.
struct Side {
    std::uint32_t low = 0;  // the lesser of its vertices
    std::uint32_t high = 0;
    std::uint32_t triangle = 0;
    bool forward = false;  // from low to high
};

/// The sides of the triangles for which `counts` is not 0, by edge, then by triangle.
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
    std::vector<std::uint8_t> flip;  // 1 for each triangle that has to be turned over to agree with its neighbours
    bool orientable = true;
};

/// Makes neighbours over edges of two triangles agree. Of each part, the lesser half is turned over; of two equal
/// halves that without the part's first triangle.
[[nodiscard]] Orientation orient(std::size_t triangles, std::span<const Side> sides);

struct Fans {
    std::size_t pinched = 0;  // vertices whose triangles make more than one fan
    std::uint32_t first = 0;  // of them
};

[[nodiscard]] Fans count_fans(std::span<const Triangle> triangles, std::span<const std::uint8_t> counts,
                              std::span<const Side> sides, std::size_t vertices);

/// Parts that share no vertex; each vertex belongs to some triangle.
[[nodiscard]] std::size_t count_parts(std::span<const Triangle> triangles, std::size_t vertices);

}  // namespace haptic::sim::detail
