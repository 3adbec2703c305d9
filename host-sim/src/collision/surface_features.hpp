// Features of surfaces: the vertices, edges and triangles of all surfaces whose vertices are particles, and the search
// for pairs of them that may meet: a vertex and a triangle, or two edges, that share no vertex.
//
// Triangles lie in blocks of up to sixteen, in an order of median splits at rest, and every vertex and edge belongs to
// one block (representative triangles; Curtis et al. 2008), so that no pair is found twice. Boxes lie side by side in
// this order, so that one is compared with a whole block at a time; groups of sixteen blocks, groups of groups and so
// on have boxes too. A search goes through pairs of them from the top.
//
// Boxes hold the expected ways of vertices, all of them in the same time, in a frame that moves with the mean way of
// their block or group. Of two frames, one moves relative to the other: a box is extended by this before it is compared
// with boxes in another frame. Parts of a surface that move alike so have small boxes, however fast they are, and the
// number of pairs does not grow where a finer mesh has shorter edges. Boxes are rounded to float, outward.
// @source S. Curtis, R. Tamstorf, D. Manocha, "Fast Collision Detection for Deformable Models using
// Representative-Triangles", 2008
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <set>
#include <span>
#include <vector>

#include "haptic/sim/mesh.hpp"
#include "haptic/types.hpp"
#include "simd/collider_rows.hpp"
#include "simd/features.hpp"

namespace haptic::sim {

/// A surface whose vertices are particles.
struct ParticleSurface {
    std::uint32_t first_particle = 0;
    std::span<const Triangle> triangles;  // of its own vertices; the second face of a double-faced one is ignored
    std::span<const Vec3> rest;           // m, per vertex
    std::span<const std::uint8_t> left_alone = {};  // per vertex, 1: not kept apart from one another; empty: none
};

class SurfaceFeatures {
  public:
    using Edge = std::array<std::uint32_t, 2>;
    /// The most pairs that a search hands over together.
    static constexpr std::size_t kMaxTogether = 8192;
    /// Where a vertex is expected over the time for which pairs are searched, m: at `start + s way`, where s goes from
    /// 0 to 1 for all of them alike, or up to `margin` away from there along each axis.
    struct Path {
        Vec3 start{0.0};
        Vec3 way{0.0};
        Vec3 margin{0.0};
    };

    /// Vertices have the numbers of their particles. Throws std::invalid_argument for an index out of range.
    explicit SurfaceFeatures(std::span<const ParticleSurface> surfaces, const ColliderKernels& kernels);

    /// The vertices that a triangle has.
    [[nodiscard]] std::span<const std::uint32_t> vertices() const noexcept { return vertex_; }
    [[nodiscard]] std::span<const Triangle> triangles() const noexcept { return triangle_; }
    [[nodiscard]] std::span<const Edge> edges() const noexcept { return edge_; }

    /// Four arrays of vertices of equal length, those of the first features before those of the second.
    using PairedVertices = std::array<std::span<const std::uint32_t>, 4>;
    /// Finds the pairs of features that may meet while their vertices are near their paths, and others whose boxes
    /// overlap, some thousands at a time: calls found(kind, PairedVertices). `path` has one element per particle.
    template <class Found>
    void search(std::span<const Path> path, const Found& found) {
        fit_boxes(path);
        begin_search();
        while (search_more()) {
            for (const PairKind kind : {PairKind::VertexTriangle, PairKind::EdgeEdge}) {
                Candidates& some = candidates_[kind == PairKind::VertexTriangle ? 0 : 1];
                if (some.size > 0) {
                    found(kind, some.vertices());
                }
                some.size = 0;
            }
        }
    }

  private:
    static constexpr std::size_t kFanOut = 16;
    static constexpr std::size_t kPadding = 16;

    /// Boxes in rows: low x, y, z, then high; with room for a whole vector behind.
    struct Boxes {
        void resize(std::size_t boxes);
        [[nodiscard]] BoxRows rows() const noexcept { return {number.data(), length}; }
        [[nodiscard]] RoundedBox operator[](std::size_t at) const noexcept;
        void set(std::size_t at, const RoundedBox& box) noexcept;
        std::size_t size = 0;
        std::size_t length = 0;
        std::vector<float> number;
    };
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
    /// Pairs of one kind, with room for as many as a search hands over together.
    struct Candidates {
        std::array<std::vector<std::uint32_t>, 4> vertex;
        std::size_t size = 0;
        /// Adds a pair, unless it is not wanted. Whether it is follows no pattern that a processor could predict: the
        /// vertices are written either way.
        void add(bool wanted, std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) noexcept {
            vertex[0][size] = a;
            vertex[1][size] = b;
            vertex[2][size] = c;
            vertex[3][size] = d;
            size += wanted ? 1 : 0;
        }
        [[nodiscard]] PairedVertices vertices() const noexcept {
            return {std::span(vertex[0]).first(size), std::span(vertex[1]).first(size),
                    std::span(vertex[2]).first(size), std::span(vertex[3]).first(size)};
        }
    };
    /// Two nodes of a level whose boxes overlap; the first is not after the second.
    struct NodePair {
        std::uint32_t level;
        std::uint32_t first;
        std::uint32_t second;
    };

    void add_surface(const ParticleSurface& surface);
    void order_blocks(std::span<const Vec3> centre, std::span<std::uint32_t> order);
    void own_features(const Range& triangles, std::vector<std::uint8_t>& owned, std::set<Edge>& known);
    void list_corners();
    void fit_boxes(std::span<const Path> path);
    void fit_block(std::size_t at, std::span<const Path> path);
    void fit_groups();
    void begin_search();
    [[nodiscard]] bool search_more();
    void descend(const NodePair& pair);
    void compare(std::uint32_t first, std::uint32_t second);
    void compare_vertices(std::uint32_t of, std::uint32_t with);
    void compare_edges(std::uint32_t of, std::uint32_t with);
    [[nodiscard]] std::span<const std::uint32_t> reaching(const Boxes& boxes, const Range& range, std::uint32_t of,
                                                          std::uint32_t with);

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
    // Of the search. Boxes of features are in the frame of their block.
    Boxes vertex_box_;
    Boxes edge_box_;
    Boxes triangle_box_;
    std::vector<RoundedBox> block_box_;         // in its own frame
    std::vector<Boxes> level_;                  // the first of blocks, each later one of groups of the one before; each
                                                // box in the frame of the group to which it belongs
    std::vector<std::vector<Vec3>> frame_way_;  // m, of the frames of each level, the last that of everything
    std::vector<NodePair> pending_;
    std::vector<std::uint32_t> hit_;
    std::vector<std::uint32_t> reaching_;
    std::array<Candidates, 2> candidates_;
};

}  // namespace haptic::sim
