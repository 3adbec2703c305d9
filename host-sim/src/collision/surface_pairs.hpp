// Pairs of features of surfaces that may come too near on their paths, of two surfaces and of one.
//
// Of two surfaces they are found by their swept trees and by boxes around the paths (feature_blocks.hpp), of one
// surface by how its parts have deformed (own_pairs.hpp), and proved apart (feature_pairs.hpp) where that is possible.
// The others are listed. Those of two surfaces are found with a reach around the ends of paths; pairs are searched
// again where rounds have moved vertices farther. Those of one surface are searched again for the vertices that rounds
// have moved. A surface that is turned inside out would have them by the million: it is given up before they are
// listed.
//
// Surfaces that cross or touch at the beginning are left to one another until their boxes part. Features of one surface
// that do are left alone, as are others all of whose vertices belong to such.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "collision/body_sweep.hpp"
#include "collision/feature_blocks.hpp"
#include "collision/feature_pairs.hpp"
#include "collision/listed_pairs.hpp"
#include "collision/own_pairs.hpp"
#include "collision/surface_paths.hpp"
#include "dynamics/workers.hpp"
#include "haptic/types.hpp"
#include "simd/collider_rows.hpp"
#include "simd/deformation.hpp"
#include "simd/features.hpp"

namespace haptic::sim {

/// What crosses at the start, and so is left alone.
struct SurfacesAtStart {
    std::vector<BodyPair> crossing;       // surfaces
    std::vector<std::uint32_t> vertices;  // of edges and triangles of a surface that cross others of it
};

class SurfacePairs {
  public:
    /// `start`: vertices of all surfaces, m, to which all trees have been fitted. `left_alone`: what crosses there;
    /// what touches there is left alone too. `paths` outlive it. Throws std::invalid_argument for a number of lanes
    /// that this machine lacks. Results do not depend on it.
    SurfacePairs(SurfacePaths& paths, std::span<const Vec3> start, SurfacesAtStart left_alone, std::size_t lanes);
    SurfacePairs(const SurfacePairs&) = delete;
    SurfacePairs& operator=(const SurfacePairs&) = delete;

    /// No surface can meet anything: nothing is to be searched.
    [[nodiscard]] bool is_empty() const noexcept { return meets_.empty() && own_.empty(); }
    /// Whether two surfaces are kept apart: one of them can be pushed, and they are not left to one another.
    [[nodiscard]] bool keeps_apart(std::uint32_t one, std::uint32_t other) const noexcept;
    [[nodiscard]] bool leaves_alone(std::size_t vertex) const noexcept { return leaves_alone_[vertex] != 0; }

    /// Begins a step: takes over the motion of the last one. Once per step, not before repeated attempts at it.
    void begin_step() noexcept;
    /// A surface that meets itself goes the way of its paths, all at once, without a search: after a step.
    void jump(std::uint32_t surface);
    /// Finds the pairs on the paths that are asked, from `start` to `end`, m, after SurfacePaths::begin_attempt(). All
    /// trees have been refitted to both.
    void search(std::span<const Vec3> start, std::span<const Vec3> end, Workers& workers);
    /// Finds them where rounds have moved vertices since. False: none has moved far enough. `start`, `end`: for
    /// surfaces that take part only now.
    [[nodiscard]] bool search_again(std::span<const Vec3> start, std::span<const Vec3> end, Workers& workers);

    /// Whether no surface was given up in the last search.
    [[nodiscard]] bool knows_all() const noexcept;
    /// Calls visit(surface) with those that were.
    template <class Visit>
    void for_each_given_up(const Visit& visit) const {
        for (const Own& own : own_) {
            if (own.is_given_up) {
                visit(own.surface);
            }
        }
    }
    /// Two surfaces each that are kept apart and whose boxes overlap, of the last search.
    [[nodiscard]] std::span<const BodyPair> meetings() const noexcept { return meetings_; }
    /// Calls visit(list) with the lists of pairs of one surface, then of two.
    template <class Visit>
    void for_each_list(const Visit& visit) {
        for (Part& part : parts_) {
            for (ListedPairs& list : part.pairs) {
                visit(list);
            }
        }
    }

  private:
    struct BlockPair {
        std::uint32_t first;
        std::uint32_t second;
    };
    /// Listed pairs of one surface that meets itself, or of some pairs of blocks of two.
    struct Part {
        std::array<ListedPairs, 2> pairs{ListedPairs(PairKind::VertexTriangle), ListedPairs(PairKind::EdgeEdge)};
        std::vector<BodyPair> touching;  // surfaces with features that touch
        // Of the search.
        std::vector<std::uint8_t> is_dropped;  // per pair
        FeatureBlocks::Comparison comparison;
        DoubtfulPairs in_doubt;

        void make_room(std::size_t in_list);
    };
    /// Pairs that stay listed though they are searched again: of vertices and triangles, then of edges, in order.
    using RetainedPairs = std::array<std::vector<PairVertices>, 2>;
    /// Of a surface that meets itself.
    struct Own {
        Own(std::uint32_t of, FeatureBlocks all, const DeformationKernels& kernels, double mean_edge)
            : surface(of),
              edge(mean_edge),
              blocks(std::move(all)),
              pairs(blocks, kernels, mean_edge),
              is_fitted(blocks.size(), 0) {}
        void make_room(std::size_t vertices, std::size_t in_list);
        std::uint32_t surface;
        double edge;  // m, mean
        FeatureBlocks blocks;
        OwnPairs pairs;
        bool motion_is_taken = false;      // in this attempt; after the last one advance() is due
        std::size_t from_afar = 0;         // pairs of the last search that are far apart at the start
        bool is_given_up = false;          // in this attempt: they were too many
        std::vector<std::uint32_t> moved;  // vertices, by rounds since the last search
        // Of the search.
        RetainedPairs retained;               // of pairs of new surroundings
        std::vector<std::uint8_t> is_fitted;  // per block
        std::array<OwnPairs::Due, 2> due;     // vertices and triangles, then edges
    };

    void make_room();
    [[nodiscard]] double farthest_stray() const noexcept;
    void find_due() noexcept;
    void find_meetings(double margin);
    void search_meetings(std::span<const Vec3> start, std::span<const Vec3> end, Workers& workers);
    template <class IsDue>
    void drop(Part& part, RetainedPairs& retained, const IsDue& is_due) const;
    void drop_due();
    [[nodiscard]] bool some_are_due(std::span<const std::uint32_t> vertices) const noexcept;
    void find_block_pairs(double margin, Workers& workers);
    void drop_blocks_apart(double apart, Workers& workers);
    void find_pairs_of_two(double apart, Workers& workers);
    void leave_touching_alone();
    void search_own_first(std::span<const Vec3> start, std::span<const Vec3> end, Workers& workers);
    [[nodiscard]] bool search_own_moved(Workers& workers);
    [[nodiscard]] bool rests(const Own& own) const noexcept;
    void collect_moved();
    void take_motion(Own& own);
    void drop_new(Own& own, Part& part) const;
    void list_own(Own& own, Part& part);
    template <class PathOf, class Take>
    void compare_own(Own& own, Part& part, std::uint32_t block, const PathOf& path_of, const Take& take);
    void find_own(Own& own, Part& part);
    template <class BlockOf>
    void keep_own(Own& own, Part& part, PairKind kind, const PairCandidates::Vertices& vertices,
                  const BlockOf& block_of);
    [[nodiscard]] bool are_left_alone(const PairVertices& vertex) const noexcept;
    void list_near_blocks();
    void find_blocks(const BodyPair& surfaces, double margin, std::vector<BlockPair>& overlapping) const;
    void find_pairs(Part& part, std::span<const BlockPair> blocks) const;
    template <class IsLeftOut, class Kept>
    void keep_near(Part& part, PairKind kind, const PairCandidates::Vertices& vertex, double apart,
                   const IsLeftOut& is_left_out, const Kept& kept) const;
    [[nodiscard]] bool have_left_reach() const noexcept;

    SurfacePaths& paths_;
    FeatureBlocks blocks_;                    // of all, one for each leaf of a tree
    std::vector<std::uint32_t> first_block_;  // per surface
    const FeatureKernels& kernels_;
    double touching_ = 0.0;                   // m: features that are nearer touch
    double reach_;                            // m: how far rounds may move a vertex before pairs are searched again
    double own_apart_;                        // m: pairs of one surface that are to be nearer than this are kept
    std::vector<std::uint8_t> leaves_alone_;  // per vertex: it touched or crossed its own surface at the start
    // Of two surfaces.
    std::vector<std::uint8_t> is_due_;  // per vertex: its pairs are to be searched
    RetainedPairs retained_;            // of these
    std::vector<BodyPair> left_alone_;  // in order
    std::vector<std::uint32_t> meets_;  // surfaces that meet others
    BodySweep sweep_;                   // of these
    std::vector<Bounds> bounds_;        // of these
    double farthest_ = 0.0;             // m, coordinate of these
    std::vector<BodyPair> near_;
    std::vector<BodyPair> meetings_;                   // surfaces
    std::vector<std::vector<BlockPair>> overlapping_;  // per meeting: blocks whose boxes do
    std::vector<BlockPair> block_pairs_;               // of all meetings
    std::vector<std::uint8_t> apart_;                  // per pair of blocks
    std::vector<std::uint32_t> near_blocks_;
    std::vector<std::uint8_t> is_near_;  // per block
    // Of one.
    std::vector<Own> own_;
    std::vector<std::uint32_t> own_of_;  // per surface; kNotOwn: it does not meet itself

    std::vector<Part> parts_;  // one for each of own_, then of pairs of surfaces
};

}  // namespace haptic::sim
