// Features of surfaces in blocks: the vertices, edges and triangles of some surfaces, and which of two blocks may meet:
// a vertex and a triangle, or two edges, that share no vertex.
//
// A block has up to sixteen triangles that lie near one another. Every vertex and edge belongs to one block
// (representative triangles; Curtis et al. 2008), so that no pair is found twice. Boxes of a block's features lie side
// by side, so that one is compared with a whole block at a time.
//
// Boxes hold the expected ways of vertices, all of them in the same time, in a frame that moves with the mean way of
// their block. Of two frames, one moves relative to the other: a box is extended by this before it is compared with
// boxes in another frame. Parts of a surface that move alike so have small boxes, however fast they are. Boxes are
// rounded to float, outward.
// @source S. Curtis, R. Tamstorf, D. Manocha, "Fast Collision Detection for Deformable Models using
// Representative-Triangles", 2008
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "collision/rounded_boxes.hpp"
#include "haptic/sim/mesh.hpp"
#include "haptic/types.hpp"
#include "simd/collider_rows.hpp"
#include "simd/features.hpp"

namespace haptic::sim {

/// Where a vertex is expected over the time for which pairs are searched, m: at `start + s way`, where s goes from 0 to
/// 1 for all of them alike, or up to `margin` away from there along each axis.
struct VertexPath {
    Vec3 start{0.0};
    Vec3 way{0.0};
    Vec3 margin{0.0};
};

/// Where pairs of a kind are, in what holds both.
[[nodiscard]] constexpr std::size_t list_of(PairKind kind) noexcept {
    return kind == PairKind::VertexTriangle ? 0 : 1;
}

/// Vertices of some pairs of one kind: those of the first features before those of the second.
class PairCandidates {
  public:
    using Vertices = std::array<std::span<const std::uint32_t>, 4>;

    void make_room(std::size_t pairs) {
        for (std::vector<std::uint32_t>& of : vertex_) {
            of.resize(std::max(of.size(), pairs));
        }
    }
    void clear() noexcept { size_ = 0; }
    [[nodiscard]] std::size_t size() const noexcept { return size_; }
    /// Adds a pair, for which there must be room, unless it is not wanted. Whether it is follows no pattern that a
    /// processor could predict: the vertices are written either way.
    void add(bool wanted, std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) noexcept {
        vertex_[0][size_] = a;
        vertex_[1][size_] = b;
        vertex_[2][size_] = c;
        vertex_[3][size_] = d;
        size_ += wanted ? 1 : 0;
    }
    [[nodiscard]] Vertices vertices() const noexcept {
        return {std::span(vertex_[0]).first(size_), std::span(vertex_[1]).first(size_),
                std::span(vertex_[2]).first(size_), std::span(vertex_[3]).first(size_)};
    }

  private:
    std::array<std::vector<std::uint32_t>, 4> vertex_;
    std::size_t size_ = 0;
};

class FeatureBlocks {
  public:
    using Edge = std::array<std::uint32_t, 2>;
    static constexpr std::size_t kMaxInBlock = 16;  // triangles
    /// The most pairs of a kind that two blocks add: edges are three times the triangles at most.
    static constexpr std::size_t kMaxOfTwoBlocks = 9 * kMaxInBlock * kMaxInBlock;

    explicit FeatureBlocks(const ColliderKernels& kernels) : kernels_(kernels) {}

    /// Appends a surface whose triangles lie block by block, so many in each, at most kMaxInBlock.
    void add_surface(std::span<const Triangle> triangles, std::span<const std::uint32_t> in_block);
    /// Call after the last surface.
    void make_boxes();

    [[nodiscard]] std::size_t size() const noexcept { return block_.size(); }
    /// The vertices that a triangle has, and all triangles and edges, in the order of blocks.
    [[nodiscard]] std::span<const std::uint32_t> vertices() const noexcept { return vertex_; }
    [[nodiscard]] std::span<const Triangle> triangles() const noexcept { return triangle_; }
    [[nodiscard]] std::span<const Edge> edges() const noexcept { return edge_; }
    /// Triangles of a block.
    [[nodiscard]] std::span<const Triangle> triangles_of(std::size_t block) const noexcept {
        const Range& range = block_[block].triangles;
        return {triangle_.data() + range.begin, range.end - range.begin};
    }
    /// Vertices of a block's triangles, each once.
    [[nodiscard]] std::span<const std::uint32_t> corners_of(std::size_t block) const noexcept {
        const Range& range = block_[block].corners;
        return {corner_.data() + range.begin, range.end - range.begin};
    }

    /// Takes the corners of a block at both ends of their ways, m: place_of(vertex) is a pair of them. Of different
    /// blocks on any thread.
    template <class PlaceOf>
    void place(std::size_t block, const PlaceOf& place_of) noexcept;
    /// Whether two blocks that have been placed are so far apart, m, along one of a few directions, at both ends of
    /// their ways: and so all the way. A quick test before features are compared.
    [[nodiscard]] bool are_apart(std::size_t first, std::size_t second, double gap) const noexcept;

    /// m, how much farther apart are_apart() may take blocks to be than they are, with coordinates up to `farthest`, m.
    [[nodiscard]] static double rounding_of_places(double farthest) noexcept {
        return 16.0 * static_cast<double>(kRoundingOfFloats) * farthest;
    }

    /// Fits the boxes of a block and its features to the VertexPath path_of(vertex). Of different blocks on any thread.
    template <class PathOf>
    void fit(std::size_t block, const PathOf& path_of) noexcept;
    /// Of the whole block, in its own frame, and the way of that, m.
    [[nodiscard]] const RoundedBox& box(std::size_t block) const noexcept { return box_[block]; }
    [[nodiscard]] const Vec3& frame_way(std::size_t block) const noexcept { return frame_way_[block]; }

    /// What a comparison needs besides.
    struct Comparison {
        Comparison();
        /// Calls take(kind, vertices) with the candidates of each kind that has so many, and clears these.
        template <class Take>
        void hand_over(std::size_t at_least, const Take& take);
        std::array<PairCandidates, 2> candidates;  // vertices and triangles, then edges
        std::vector<std::uint32_t> hit;
        std::vector<std::uint32_t> reaching;
    };
    /// Adds the pairs of two blocks that may meet, one of each or, of a block with itself, both of it.
    void compare(std::size_t first, std::size_t second, Comparison& in) const;

  private:
    struct Range {
        std::uint32_t begin = 0;
        std::uint32_t end = 0;
    };
    struct Block {
        Range vertices;
        Range edges;
        Range triangles;
        Range corners;
    };

    /// Places of a block's corners in rows x, y, z at the start, then at the end of their ways.
    static constexpr std::size_t kPlaceRows = 6;
    static constexpr std::size_t kPlacePadding = 4;  // a row has whole vectors; the last place is repeated
    struct Placed {
        std::uint32_t first = 0;   // of the rows
        std::uint32_t length = 0;  // of a row
        float normal[3] = {};      // m^2, of all triangles at the start, of any length
        float centre[3] = {};      // m, at the start
    };

    void list_corners(Block& block);
    void describe(std::size_t block) noexcept;
    [[nodiscard]] bool are_apart_along(const float (&direction)[3], const Placed& first, const Placed& second,
                                       double gap) const noexcept;
    void fit_features(const Block& block, const RoundedBox* corner) noexcept;
    void compare_vertices(std::size_t of, std::size_t with, Comparison& in) const noexcept;
    void compare_edges(std::size_t of, std::size_t with, Comparison& in) const noexcept;
    [[nodiscard]] std::span<const std::uint32_t> reaching(const RoundedBoxes& boxes, const Range& range, std::size_t of,
                                                          std::size_t with, Comparison& in) const noexcept;

    const ColliderKernels& kernels_;
    // By block.
    std::vector<Triangle> triangle_;
    std::vector<Edge> edge_;
    std::vector<std::uint32_t> vertex_;
    std::vector<Block> block_;
    // Vertices of the blocks' triangles, each once per block, and which of them each triangle, edge and vertex has.
    std::vector<std::uint32_t> corner_;
    std::vector<std::array<std::uint8_t, 3>> corner_of_triangle_;
    std::vector<std::array<std::uint8_t, 2>> corner_of_edge_;
    std::vector<std::uint8_t> corner_of_vertex_;
    std::vector<Placed> placed_;  // per block
    std::vector<float> place_;
    // Boxes, in the frame of the block.
    RoundedBoxes vertex_box_;
    RoundedBoxes edge_box_;
    RoundedBoxes triangle_box_;
    std::vector<RoundedBox> box_;
    std::vector<Vec3> frame_way_;  // m
};

template <class Take>
void FeatureBlocks::Comparison::hand_over(std::size_t at_least, const Take& take) {
    for (const PairKind kind : {PairKind::VertexTriangle, PairKind::EdgeEdge}) {
        PairCandidates& some = candidates[list_of(kind)];
        if (some.size() >= at_least) {
            take(kind, some.vertices());
            some.clear();
        }
    }
}

template <class PlaceOf>
void FeatureBlocks::place(std::size_t block, const PlaceOf& place_of) noexcept {
    const std::span<const std::uint32_t> corner = corners_of(block);
    const std::size_t length = placed_[block].length;
    float* const row = place_.data() + placed_[block].first;
    for (std::size_t c = 0; c < length; ++c) {
        const auto& [start, end] = place_of(corner[std::min(c, corner.size() - 1)]);
        for (int k = 0; k < 3; ++k) {
            const auto axis = static_cast<std::size_t>(k);
            row[axis * length + c] = static_cast<float>(start[k]);
            row[(axis + 3) * length + c] = static_cast<float>(end[k]);
        }
    }
    describe(block);
}

template <class PathOf>
void FeatureBlocks::fit(std::size_t block, const PathOf& path_of) noexcept {
    const std::span<const std::uint32_t> corner = corners_of(block);
    Vec3 sum(0.0);
    for (const std::uint32_t v : corner) {
        sum += path_of(v).way;
    }
    const Vec3 frame_way = sum / static_cast<double>(corner.size());
    frame_way_[block] = frame_way;
    // Of the corners, then of what consists of them.
    std::array<RoundedBox, 3 * kMaxInBlock> box;  // NOLINT(cppcoreguidelines-pro-type-member-init): written first
    RoundedBox whole = empty_box();
    for (std::size_t c = 0; c < corner.size(); ++c) {
        const VertexPath& of = path_of(corner[c]);
        box[c] = box_around(of.start, of.start + (of.way - frame_way), of.margin);
        include(whole, box[c]);
    }
    box_[block] = whole;
    fit_features(block_[block], box.data());
}

}  // namespace haptic::sim
