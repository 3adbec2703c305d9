// The search for features of surfaces that may meet, among all surfaces whose vertices are particles.
//
// Triangles lie in blocks (feature_blocks.hpp) in an order of median splits at rest. Groups of sixteen blocks, groups
// of groups and so on have boxes too, each in the frame of the mean way of its group. A search goes through pairs of
// them from the top. The number of pairs does not grow where a finer mesh has shorter edges.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "collision/feature_blocks.hpp"
#include "collision/rounded_boxes.hpp"
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
    /// The most pairs that a search hands over together.
    static constexpr std::size_t kMaxTogether = 8192;

    /// Vertices have the numbers of their particles. Throws std::invalid_argument for an index out of range.
    explicit SurfaceFeatures(std::span<const ParticleSurface> surfaces, const ColliderKernels& kernels);

    /// The vertices that a triangle has.
    [[nodiscard]] std::span<const std::uint32_t> vertices() const noexcept { return blocks_.vertices(); }
    [[nodiscard]] std::span<const Triangle> triangles() const noexcept { return blocks_.triangles(); }
    [[nodiscard]] std::span<const FeatureBlocks::Edge> edges() const noexcept { return blocks_.edges(); }

    /// Finds the pairs of features that may meet while their vertices are near their paths, and others whose boxes
    /// overlap, some thousands at a time: calls found(kind, PairCandidates::Vertices). `path` has one element per
    /// particle.
    template <class Found>
    void search(std::span<const VertexPath> path, const Found& found) {
        fit_boxes(path);
        begin_search();
        while (search_more()) {
            for (const PairKind kind : {PairKind::VertexTriangle, PairKind::EdgeEdge}) {
                PairCandidates& some = comparison_.candidates[list_of(kind)];
                if (some.size() > 0) {
                    found(kind, some.vertices());
                }
                some.clear();
            }
        }
    }

  private:
    static constexpr std::size_t kFanOut = 16;

    /// Two nodes of a level whose boxes overlap; the first is not after the second.
    struct NodePair {
        std::uint32_t level;
        std::uint32_t first;
        std::uint32_t second;
    };

    void add_surface(const ParticleSurface& surface);
    void order_blocks(std::span<const Vec3> centre, std::span<std::uint32_t> order);
    void fit_boxes(std::span<const VertexPath> path);
    void fit_groups();
    void begin_search();
    [[nodiscard]] bool search_more();
    void descend(const NodePair& pair);

    const ColliderKernels& kernels_;
    FeatureBlocks blocks_;
    // Of the search.
    std::vector<RoundedBoxes> level_;           // the first of blocks, each later one of groups of the one before; each
                                                // box in the frame of the group to which it belongs
    std::vector<std::vector<Vec3>> frame_way_;  // m, of the frames of each level, the last that of everything
    std::vector<NodePair> pending_;
    std::vector<std::uint32_t> hit_;
    FeatureBlocks::Comparison comparison_;
};

}  // namespace haptic::sim
