#include "collision/feature_blocks.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "simd/lanes.hpp"

namespace haptic::sim {
namespace {

// Of a direction: what is shorter has lost its digits.
constexpr float kLeastSquare = 1e-30F;

// Without branches: see PairCandidates::add().
bool has(const Triangle& triangle, std::uint32_t vertex) noexcept {
    return (static_cast<int>(triangle[0] == vertex) | static_cast<int>(triangle[1] == vertex) |
            static_cast<int>(triangle[2] == vertex)) != 0;
}

bool share(const FeatureBlocks::Edge& a, const FeatureBlocks::Edge& b) noexcept {
    return (static_cast<int>(a[0] == b[0]) | static_cast<int>(a[0] == b[1]) | static_cast<int>(a[1] == b[0]) |
            static_cast<int>(a[1] == b[1])) != 0;
}

FeatureBlocks::Edge edge_of(const Triangle& triangle, std::size_t side) noexcept {
    const auto [low, high] = std::minmax(triangle[side], triangle[(side + 1) % 3]);
    return {low, high};
}

/// The first and the last vertex.
std::pair<std::uint32_t, std::uint32_t> vertices_of(std::span<const Triangle> triangles) noexcept {
    std::uint32_t first = triangles.empty() ? 0 : triangles[0][0];
    std::uint32_t last = first;
    for (const Triangle& t : triangles) {
        first = std::min({first, t[0], t[1], t[2]});
        last = std::max({last, t[0], t[1], t[2]});
    }
    return {first, last};
}

/// Per side of each triangle: 1 if none before it is the same edge.
std::vector<std::uint8_t> first_of_edges(std::span<const Triangle> triangles) {
    std::vector<std::pair<FeatureBlocks::Edge, std::size_t>> sides;
    sides.reserve(3 * triangles.size());
    for (std::size_t t = 0; t < triangles.size(); ++t) {
        for (std::size_t k = 0; k < 3; ++k) {
            sides.emplace_back(edge_of(triangles[t], k), 3 * t + k);
        }
    }
    std::ranges::sort(sides);
    std::vector<std::uint8_t> first(sides.size(), 1);
    for (std::size_t k = 1; k < sides.size(); ++k) {
        first[sides[k].second] = sides[k].first != sides[k - 1].first ? 1 : 0;
    }
    return first;
}

}  // namespace

FeatureBlocks::Comparison::Comparison()
    : hit(3 * kMaxInBlock + RoundedBoxes::kPadding), reaching(3 * kMaxInBlock + RoundedBoxes::kPadding) {}

/// Gives each vertex and edge to the first block that has it.
void FeatureBlocks::add_surface(std::span<const Triangle> triangles, std::span<const std::uint32_t> in_block) {
    const auto [first_vertex, last_vertex] = vertices_of(triangles);
    std::vector<std::uint8_t> owned(last_vertex - first_vertex + 1U, 0);
    const std::vector<std::uint8_t> has_edge = first_of_edges(triangles);
    std::size_t next = 0;
    for (const std::uint32_t count : in_block) {
        Block block;
        block.triangles.begin = static_cast<std::uint32_t>(triangle_.size());
        block.vertices.begin = static_cast<std::uint32_t>(vertex_.size());
        block.edges.begin = static_cast<std::uint32_t>(edge_.size());
        for (const std::size_t end = next + count; next < end; ++next) {
            const Triangle& t = triangles[next];
            triangle_.push_back(t);
            for (std::size_t k = 0; k < 3; ++k) {
                if (std::exchange(owned[t[k] - first_vertex], std::uint8_t{1}) == 0) {
                    vertex_.push_back(t[k]);
                }
                if (has_edge[3 * next + k] != 0) {
                    edge_.push_back(edge_of(t, k));
                }
            }
        }
        block.triangles.end = static_cast<std::uint32_t>(triangle_.size());
        block.vertices.end = static_cast<std::uint32_t>(vertex_.size());
        block.edges.end = static_cast<std::uint32_t>(edge_.size());
        list_corners(block);
        block_.push_back(block);
    }
}

/// Lists the vertices of a block's triangles. Its own vertices and edges are among them.
void FeatureBlocks::list_corners(Block& block) {
    block.corners.begin = static_cast<std::uint32_t>(corner_.size());
    for (std::uint32_t t = block.triangles.begin; t < block.triangles.end; ++t) {
        corner_.insert(corner_.end(), triangle_[t].begin(), triangle_[t].end());
    }
    const auto first = corner_.begin() + block.corners.begin;
    std::sort(first, corner_.end());
    corner_.erase(std::unique(first, corner_.end()), corner_.end());
    block.corners.end = static_cast<std::uint32_t>(corner_.size());
    const auto place_of = [&](std::uint32_t v) {
        return static_cast<std::uint8_t>(std::lower_bound(first, corner_.end(), v) - first);
    };
    for (std::uint32_t t = block.triangles.begin; t < block.triangles.end; ++t) {
        std::ranges::transform(triangle_[t], corner_of_triangle_.emplace_back().begin(), place_of);
    }
    for (std::uint32_t e = block.edges.begin; e < block.edges.end; ++e) {
        std::ranges::transform(edge_[e], corner_of_edge_.emplace_back().begin(), place_of);
    }
    for (std::uint32_t v = block.vertices.begin; v < block.vertices.end; ++v) {
        corner_of_vertex_.push_back(place_of(vertex_[v]));
    }
}

void FeatureBlocks::make_boxes() {
    vertex_box_.resize(vertex_.size());
    edge_box_.resize(edge_.size());
    triangle_box_.resize(triangle_.size());
    box_.resize(block_.size());
    frame_way_.resize(block_.size());
    std::size_t places = 0;
    for (std::size_t k = 0; k < block_.size(); ++k) {
        const std::size_t length = (corners_of(k).size() + kPlacePadding - 1) / kPlacePadding * kPlacePadding;
        placed_.push_back({.first = static_cast<std::uint32_t>(places), .length = static_cast<std::uint32_t>(length)});
        places += kPlaceRows * length;
    }
    place_.resize(places);
}

/// What are_apart() needs of a block whose corners have been placed.
void FeatureBlocks::describe(std::size_t block) noexcept {
    Placed& placed = placed_[block];
    const std::size_t length = placed.length;
    const float* const x = place_.data() + placed.first;
    const float* const y = x + length;
    const float* const z = y + length;
    float normal[3] = {};
    const Range& triangles = block_[block].triangles;
    for (std::uint32_t t = triangles.begin; t < triangles.end; ++t) {
        const auto& [a, b, c] = corner_of_triangle_[t];
        const float u[3] = {x[b] - x[a], y[b] - y[a], z[b] - z[a]};
        const float v[3] = {x[c] - x[a], y[c] - y[a], z[c] - z[a]};
        for (std::size_t k = 0; k < 3; ++k) {
            normal[k] += u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3];
        }
    }
    for (std::size_t k = 0; k < 3; ++k) {
        placed.normal[k] = normal[k];
        placed.centre[k] = 0.5F * (x[k * length] + x[k * length + length / 2]);
    }
}

bool FeatureBlocks::are_apart(std::size_t first, std::size_t second, double gap) const noexcept {
    const Placed& one = placed_[first];
    const Placed& other = placed_[second];
    if (are_apart_along(one.normal, one, other, gap) || are_apart_along(other.normal, one, other, gap)) {
        return true;
    }
    const float between[3] = {one.centre[0] - other.centre[0], one.centre[1] - other.centre[1],
                              one.centre[2] - other.centre[2]};
    return are_apart_along(between, one, other, gap);
}

bool FeatureBlocks::are_apart_along(const float (&direction)[3], const Placed& first, const Placed& second,
                                    double gap) const noexcept {
    using Four = LaneTypes<4, float>::Real;
    struct Extent {
        float low;
        float high;
    };
    // Along the direction, at one end of the way.
    const auto extent_of = [&](const Placed& placed, std::size_t end) {
        const std::size_t length = placed.length;
        const float* const row = place_.data() + placed.first + 3 * end * length;
        const auto along = [&](std::size_t c) {
            return direction[0] * load<Four>(row + c) + direction[1] * load<Four>(row + length + c) +
                   direction[2] * load<Four>(row + 2 * length + c);
        };
        Four low = along(0);
        Four high = low;
        for (std::size_t c = kPlacePadding; c < length; c += kPlacePadding) {
            const Four at = along(c);
            low = at < low ? at : low;
            high = at > high ? at : high;
        }
        return Extent{std::min(std::min(low[0], low[1]), std::min(low[2], low[3])),
                      std::max(std::max(high[0], high[1]), std::max(high[2], high[3]))};
    };
    const float square = direction[0] * direction[0] + direction[1] * direction[1] + direction[2] * direction[2];
    if (!(square > kLeastSquare)) {
        return false;
    }
    const float least = std::sqrt(square) * above(static_cast<float>(gap));
    const Extent one = extent_of(first, 0);
    const Extent other = extent_of(second, 0);
    const bool is_ahead = one.low - other.high > least;
    if (!is_ahead && !(other.low - one.high > least)) {
        return false;
    }
    const Extent one_then = extent_of(first, 1);
    const Extent other_then = extent_of(second, 1);
    return is_ahead ? one_then.low - other_then.high > least : other_then.low - one_then.high > least;
}

/// From the boxes of its corners.
void FeatureBlocks::fit_features(const Block& block, const RoundedBox* corner) noexcept {
    for (std::uint32_t v = block.vertices.begin; v < block.vertices.end; ++v) {
        vertex_box_.set(v, corner[corner_of_vertex_[v]]);
    }
    for (std::uint32_t e = block.edges.begin; e < block.edges.end; ++e) {
        RoundedBox edge = corner[corner_of_edge_[e][0]];
        include(edge, corner[corner_of_edge_[e][1]]);
        edge_box_.set(e, edge);
    }
    for (std::uint32_t t = block.triangles.begin; t < block.triangles.end; ++t) {
        RoundedBox triangle = corner[corner_of_triangle_[t][0]];
        include(triangle, corner[corner_of_triangle_[t][1]]);
        include(triangle, corner[corner_of_triangle_[t][2]]);
        triangle_box_.set(t, triangle);
    }
}

void FeatureBlocks::compare(std::size_t first, std::size_t second, Comparison& in) const {
    for (PairCandidates& some : in.candidates) {
        some.make_room(some.size() + kMaxOfTwoBlocks);
    }
    compare_vertices(first, second, in);
    if (first != second) {
        compare_vertices(second, first, in);
    }
    compare_edges(first, second, in);
}

/// Those of a block's features, with boxes in `range`, that reach into the box of another block.
std::span<const std::uint32_t> FeatureBlocks::reaching(const RoundedBoxes& boxes, const Range& range, std::size_t of,
                                                       std::size_t with, Comparison& in) const noexcept {
    const RoundedBox into = swept(box_[with], sweep_of(frame_way_[with] - frame_way_[of]));
    const std::size_t count = kernels_.find_overlaps(boxes.rows(), into, range.begin, range.end, in.reaching.data());
    return {in.reaching.data(), count};
}

/// The vertices of a block with the triangles of another one, or its own.
void FeatureBlocks::compare_vertices(std::size_t of, std::size_t with, Comparison& in) const noexcept {
    const Range& triangles = block_[with].triangles;
    const RoundedBox sweep = sweep_of(frame_way_[of] - frame_way_[with]);
    for (const std::uint32_t v : reaching(vertex_box_, block_[of].vertices, of, with, in)) {
        const std::size_t hits = kernels_.find_overlaps(triangle_box_.rows(), swept(vertex_box_[v], sweep),
                                                        triangles.begin, triangles.end, in.hit.data());
        for (std::size_t h = 0; h < hits; ++h) {
            const Triangle& t = triangle_[in.hit[h]];
            in.candidates[0].add(!has(t, vertex_[v]), vertex_[v], t[0], t[1], t[2]);
        }
    }
}

/// The edges of a block with those of another one, or with its own that come later.
void FeatureBlocks::compare_edges(std::size_t of, std::size_t with, Comparison& in) const noexcept {
    const Range& edges = block_[with].edges;
    const RoundedBox sweep = sweep_of(frame_way_[of] - frame_way_[with]);
    for (const std::uint32_t e : reaching(edge_box_, block_[of].edges, of, with, in)) {
        const std::size_t hits = kernels_.find_overlaps(edge_box_.rows(), swept(edge_box_[e], sweep),
                                                        of == with ? e + 1 : edges.begin, edges.end, in.hit.data());
        for (std::size_t h = 0; h < hits; ++h) {
            const Edge& other = edge_[in.hit[h]];
            in.candidates[1].add(!share(edge_[e], other), edge_[e][0], edge_[e][1], other[0], other[1]);
        }
    }
}

}  // namespace haptic::sim
