#include "mesh/mesh_topology.hpp"

#include <algorithm>
#include <limits>
#include <tuple>

namespace haptic::sim::detail {
namespace {

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

/// Disjoint sets whose members each have one of two orientations (union-find with parity).
class SidedSets {
  public:
    explicit SidedSets(std::size_t count) : parent_(count), other_(count, 0) {
        std::iota(parent_.begin(), parent_.end(), 0U);
    }

    /// The smallest member of the set, and whether `i` has the opposite orientation.
    [[nodiscard]] std::pair<std::uint32_t, bool> find(std::uint32_t i) {
        std::uint32_t root = i;
        std::uint8_t side = 0;
        while (parent_[root] != root) {
            side ^= other_[root];
            root = parent_[root];
        }
        const std::uint8_t found = side;
        while (parent_[i] != root) {  // path compression
            const std::uint32_t next = std::exchange(parent_[i], root);
            const std::uint8_t to_next = std::exchange(other_[i], side);
            side ^= to_next;
            i = next;
        }
        return {root, found != 0};
    }

    /// False if both are in one set already and their orientations contradict the demand.
    bool unite(std::uint32_t i, std::uint32_t j, bool opposite) {
        const auto [a, a_other] = find(i);
        const auto [b, b_other] = find(j);
        const bool other = (a_other != b_other) != opposite;
        if (a == b) {
            return !other;
        }
        parent_[std::max(a, b)] = std::min(a, b);
        other_[std::max(a, b)] = other ? 1 : 0;
        return true;
    }

  private:
    std::vector<std::uint32_t> parent_;
    std::vector<std::uint8_t> other_;  // 1: orientation opposite to the parent's
};

std::uint32_t corner(const Triangle& triangle, std::uint32_t index, std::uint32_t vertex) {
    const auto at = static_cast<std::uint32_t>(std::find(triangle.begin(), triangle.end(), vertex) - triangle.begin());
    return 3 * index + at;
}

}  // namespace

std::vector<Side> sorted_sides(std::span<const Triangle> triangles, std::span<const std::uint8_t> counts) {
    std::vector<Side> sides;
    sides.reserve(3 * triangles.size());
    for (std::uint32_t t = 0; t < triangles.size(); ++t) {
        for (std::size_t i = 0; counts[t] != 0 && i < 3; ++i) {
            const std::uint32_t from = triangles[t][i];
            const std::uint32_t to = triangles[t][(i + 1) % 3];
            sides.push_back({std::min(from, to), std::max(from, to), t, from < to});
        }
    }
    std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
        return std::tie(a.low, a.high, a.triangle) < std::tie(b.low, b.high, b.triangle);
    });
    return sides;
}

Orientation orient(std::size_t triangles, std::span<const Side> sides) {
    Orientation orientation;
    SidedSets sets(triangles);
    for_each_edge(sides, [&](std::span<const Side> edge) {
        if (edge.size() == 2 && !sets.unite(edge[0].triangle, edge[1].triangle, edge[0].forward == edge[1].forward)) {
            orientation.orientable = false;
        }
    });
    // Per part: count both orientations, then reverse the smaller half.
    std::vector<std::uint32_t> members(triangles, 0);
    std::vector<std::uint32_t> others(triangles, 0);
    for (std::uint32_t t = 0; t < triangles; ++t) {
        const auto [root, other] = sets.find(t);
        ++members[root];
        others[root] += other ? 1U : 0U;
    }
    orientation.flip.assign(triangles, 0);
    for (std::uint32_t t = 0; t < triangles; ++t) {
        const auto [root, other] = sets.find(t);
        const bool majority_is_other = others[root] > members[root] - others[root];
        orientation.flip[t] = other != majority_is_other ? 1 : 0;
    }
    return orientation;
}

Fans count_fans(std::span<const Triangle> triangles, std::span<const std::uint8_t> counts, std::span<const Side> sides,
                std::size_t vertices) {
    // Join the corners of triangles that share an edge: each set of corners is a fan about its vertex.
    DisjointSets corners(3 * triangles.size());
    for_each_edge(sides, [&](std::span<const Side> edge) {
        for (std::size_t i = 1; i < edge.size(); ++i) {
            const std::uint32_t one = edge[i - 1].triangle;
            const std::uint32_t two = edge[i].triangle;
            for (const std::uint32_t vertex : {edge[i].low, edge[i].high}) {
                corners.unite(corner(triangles[one], one, vertex), corner(triangles[two], two, vertex));
            }
        }
    });
    // A vertex with corners in more than one set is pinched.
    std::vector<std::uint32_t> fan(vertices, kNone);
    std::vector<std::uint8_t> pinched(vertices, 0);
    for (std::uint32_t t = 0; t < triangles.size(); ++t) {
        for (std::uint32_t i = 0; counts[t] != 0 && i < 3; ++i) {
            const std::uint32_t vertex = triangles[t][i];
            const std::uint32_t root = corners.find(3 * t + i);
            pinched[vertex] |= fan[vertex] != kNone && fan[vertex] != root ? std::uint8_t{1} : std::uint8_t{0};
            fan[vertex] = root;
        }
    }
    Fans fans;
    fans.pinched = static_cast<std::size_t>(std::count(pinched.begin(), pinched.end(), 1));
    fans.first = static_cast<std::uint32_t>(std::find(pinched.begin(), pinched.end(), 1) - pinched.begin());
    return fans;
}

std::size_t count_parts(std::span<const Triangle> triangles, std::size_t vertices) {
    DisjointSets sets(vertices);
    for (const auto& [a, b, c] : triangles) {
        sets.unite(a, b);
        sets.unite(b, c);
    }
    std::size_t parts = 0;
    for (std::uint32_t i = 0; i < vertices; ++i) {
        parts += sets.find(i) == i ? 1U : 0U;
    }
    return parts;
}

void append(TriangleMesh& mesh, const TriangleMesh& added) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(), added.vertices.begin(), added.vertices.end());
    for (const Triangle& t : added.triangles) {
        mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
    }
}

bool is_sphere(std::span<const Triangle> triangles, std::size_t vertices) {
    const std::vector<std::uint8_t> all(triangles.size(), 1);
    const std::vector<Side> sides = sorted_sides(triangles, all);
    std::size_t edges = 0;
    bool closed = true;
    for_each_edge(sides, [&](std::span<const Side> of_edge) {
        ++edges;
        closed = closed && of_edge.size() == 2 && of_edge[0].forward != of_edge[1].forward;
    });
    // Euler's characteristic.
    return closed && vertices + triangles.size() == edges + 2 && count_parts(triangles, vertices) == 1 &&
           count_fans(triangles, all, sides, vertices).pinched == 0;
}

}  // namespace haptic::sim::detail
