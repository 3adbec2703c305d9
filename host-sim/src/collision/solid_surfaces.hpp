// Surfaces of solids that never pass through themselves, one another or sheets.
//
// The surface of a solid follows its particles: skinning tells where its vertices are to be at the end of a step.
// Contacts of particles keep bodies apart with forces, as ellipsoids. Surfaces differ from these, so two of them may
// be asked to cross, as may two parts of one. Here each follows as far as it can without.
//
// Invariant: at the end of every step a vertex and a triangle, or two edges, that share no vertex are at least a small
// gap apart, and on the straight paths that lead there they never touch. So nothing that has not crossed ever crosses.
// Whatever is in the way, the invariant can be kept: where all vertices stand still, or move alike, no gap closes. What
// a surface lags behind its skin it makes up for as soon as there is room, some of it in each step. Particles, forces
// and momenta are not changed by it. A sheet is where its particles are: its surface is exact, and solids follow it.
//
// Pairs of features are found in each step, of two surfaces by their swept trees and by boxes around the paths
// (feature_blocks.hpp), of one surface by how its parts have deformed (own_pairs.hpp), and proved apart
// (feature_pairs.hpp). Pairs that would come too near are first pushed apart at the ends of their paths, in several
// rounds, as long as that helps. The vertices of the pairs that are left are bound: for each pair there is a
// plane in the middle of the gap in which it was at the start, and each vertex goes as far toward its end as it can
// without leaving its side of the planes. Planes may move. Bound vertices of pairs that are bound as a whole form a
// patch; the planes of a patch share one motion, the mean of those asked of its vertices, and give way to exact
// surfaces. A vertex alone on its side of a plane needs to know nothing of the others, so bound vertices keep their
// gaps however many there are. Pairs that they meet are bound too. When no pair is left, pairs are searched again where
// rounds have moved vertices. If some are still left after many rounds, their surfaces stand still.
//
// Surfaces that cross or touch at the beginning are left to one another until their boxes part. Features of one surface
// that do are left alone, as are others all of whose vertices belong to such.
//
// Any surface may be asked to stand still, so that it does not pass through something else: let_stand().
// @source M. Li et al., "Codimensional Incremental Potential Contact", 2021 (positive distance as invariant); the rest
// is our own
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "collision/body_sweep.hpp"
#include "collision/feature_blocks.hpp"
#include "collision/feature_pairs.hpp"
#include "collision/own_pairs.hpp"
#include "contact/swept_tree.hpp"
#include "dynamics/constraint_batches.hpp"
#include "dynamics/workers.hpp"
#include "haptic/sim/mesh.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// The surface of a solid, whose vertices are consecutive ones of all.
struct SolidSurface {
    SweptTree* tree = nullptr;  // of the triangles
    std::span<const Triangle> triangles;
    std::size_t first_vertex = 0;
    std::size_t vertices = 0;
    bool meets_others = true;  // and is kept apart from those that do too
    bool meets_itself = true;  // and is kept apart from itself
    bool movable = true;       // else nothing pushes its vertices
    bool exact = false;        // not movable, and its vertices go where they are asked, or it stands still
    double floor = 0.0;        // m: no vertex is pushed below this height
};

/// What crosses at the start, and so is left alone.
struct SurfacesAtStart {
    std::vector<BodyPair> crossing;       // surfaces
    std::vector<std::uint32_t> vertices;  // of edges and triangles of a surface that cross others of it
};

/// Counts since construction.
struct SolidSurfaceCounts {
    std::uint64_t unsafe = 0;  // that the skin alone would not have kept apart
    std::uint64_t stood = 0;   // how often surfaces had to stand still
};

class SolidSurfaces {
  public:
    /// `start`: vertices of all surfaces, m, to which all trees have been fitted. `left_alone`: what
    /// crosses there. `catch_up_speed`: m/s. Throws std::invalid_argument for a number of lanes that this machine
    /// lacks. Results do not depend on it.
    SolidSurfaces(std::vector<SolidSurface> surfaces, std::span<const Vec3> start, SurfacesAtStart left_alone,
                  double catch_up_speed, std::size_t lanes);

    /// m, that is kept; features that are nearer come no nearer.
    [[nodiscard]] double least_gap() const noexcept { return least_gap_; }
    /// Whether two surfaces are kept apart: one of them can be pushed, and they are not left to one another.
    [[nodiscard]] bool keeps_apart(std::uint32_t one, std::uint32_t other) const noexcept;
    /// Whether a surface is kept apart from itself, but where all vertices of two features are left alone.
    [[nodiscard]] bool keeps_whole(std::uint32_t surface) const noexcept { return surfaces_[surface].meets_itself; }
    [[nodiscard]] bool leaves_alone(std::size_t vertex) const noexcept { return leaves_alone_[vertex] != 0; }

    /// For a surface that lags, between skinning and refit: moves its ends, m, back from the skin by the part of its
    /// lag that it cannot catch up with in a step of this length, s. Different surfaces on any thread.
    void ask(std::size_t surface, std::span<const Vec3> start, std::span<Vec3> end, double step) noexcept;
    /// Marked by 1: surfaces that do not move and cannot be pushed until this is called again. All can at first.
    void let_sleep(std::span<const std::uint8_t> asleep) noexcept;
    /// Changes the ends of the step, m, of all vertices, so that nothing crosses on straight paths from `start` to
    /// `end`. All trees have been refitted to both; those of surfaces that change are again.
    void keep_apart(std::span<const Vec3> start, std::span<Vec3> end, Workers& workers);
    /// The ends of a surface are those of its skin, whatever it lagged before.
    void forget_lag(std::size_t surface) noexcept;
    /// keep_apart() where some surfaces, marked by 1, are to stand still.
    void let_stand(std::span<const std::uint8_t> stands, std::span<const Vec3> start, std::span<Vec3> end,
                   Workers& workers);
    /// Whether a surface has stood still in the last step.
    [[nodiscard]] bool stands(std::size_t surface) const noexcept { return stands_[surface] != 0; }
    /// Whether keep_apart() may find anything to do.
    [[nodiscard]] bool may_hold_back() const noexcept;
    /// Whether a vertex of this surface is not where its skin would be.
    [[nodiscard]] bool lags(std::size_t surface) const noexcept { return most_lag_[surface] > 0.0; }
    /// m, per surface: how far a vertex is from where its skin would be, at most.
    [[nodiscard]] std::span<const double> most_lag() const noexcept { return most_lag_; }

    [[nodiscard]] const SolidSurfaceCounts& counts() const noexcept { return counts_; }

  private:
    struct BlockPair {
        std::uint32_t first;
        std::uint32_t second;
    };
    /// Two surfaces whose boxes overlap, and those of their blocks.
    struct Meeting {
        BodyPair surfaces{};
        std::vector<BlockPair> blocks;
    };
    /// Near pairs of features, with what is known of them. `origin` of one surface's own: a block, whose surroundings
    /// they are of.
    struct ListedPairs : FeaturePairs {
        using FeaturePairs::FeaturePairs;
        /// `proved`: the round in which they were last proved apart all the way; 0: none.
        struct Known {
            NearestPoints first{.distance = -1.0};  // at the start, once they were asked for
            std::uint64_t proved = 0;
        };
        std::vector<Known> known;

        void make_room(std::size_t size);
        void forget_all() noexcept;
        /// With the gap at the end.
        void add(const FeaturePairs& from, std::size_t at);
        template <class IsDropped>
        void leave_out(const IsDropped& is_dropped);
        [[nodiscard]] const NearestPoints& nearest_at_start(std::size_t at, const Row* start) noexcept;
    };
    /// Those of some pairs of blocks.
    struct Part {
        std::array<ListedPairs, 2> pairs{ListedPairs(PairKind::VertexTriangle), ListedPairs(PairKind::EdgeEdge)};
        std::vector<BodyPair> touching;  // surfaces with features that touch
        // Of the search.
        FeatureBlocks::Comparison comparison;
        DoubtfulPairs in_doubt;

        void make_room(std::size_t in_list);
    };
    /// Of a surface that meets itself.
    struct Own {
        Own(std::uint32_t of, FeatureBlocks all, const DeformationKernels& kernels, double edge)
            : surface(of), blocks(std::move(all)), pairs(blocks, kernels, edge), is_fitted(blocks.size(), 0) {}
        void make_room(std::size_t vertices, std::size_t in_list);
        std::uint32_t surface;
        FeatureBlocks blocks;
        OwnPairs pairs;
        bool motion_is_taken = false;      // in this attempt; after the last one advance() is due
        std::vector<std::uint32_t> moved;  // vertices, by rounds since the last search
        // Of the search.
        std::array<std::vector<PairVertices>, 2> retained;  // of pairs of new surroundings, in order
        std::vector<std::uint8_t> is_dropped;               // per pair of the part
        std::vector<std::uint8_t> is_fitted;                // per block
        std::array<OwnPairs::Due, 2> due;                   // vertices and triangles, then edges
    };
    /// A pair that may come too near, by its place.
    struct Unsafe {
        std::uint32_t part;
        std::uint32_t list;
        std::uint32_t pair;
    };

    /// Bound vertices that meet.
    struct Patch {
        struct Sum {
            Vec3 motion{0.0};  // m
            double vertices = 0.0;
        };
        Sum yielding;                                           // of vertices that can be pushed
        Sum led;                                                // of others
        Sum exact;                                              // of exact surfaces
        Vec3 motion{0.0};                                       // m, in common
        double lowest = std::numeric_limits<double>::lowest();  // m: the least way up that keeps all above the floor
        bool stands = false;
    };

    /// A plane between the features of a pair.
    struct Sides {
        Vec3 normal{0.0};
        Vec3 common{0.0};              // m, its motion
        double middle = 0.0;           // m, along the normal, at the end of the way less the common motion
        double half = 0.0;             // m, the distance that vertices keep from it
        std::array<double, 4> sign{};  // of the side, per vertex
    };

    void make_room();
    void follow(std::span<const Vec3> start, std::span<Vec3> end, Workers& workers);
    [[nodiscard]] double farthest_stray() const noexcept;
    void find_meetings(double margin);
    void begin_attempt() noexcept;
    void take_part(std::uint32_t surface, std::span<const Vec3> start, std::span<const Vec3> end) noexcept;
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
    void search(std::span<const Vec3> start, std::span<const Vec3> end, Workers& workers);
    void list_near_blocks();
    void note_move(std::uint32_t vertex);
    void move_end(std::uint32_t vertex, const Vec3& end) noexcept;
    void find_blocks(Meeting& meeting, double margin) const;
    void find_pairs(Part& part, std::span<const BlockPair> blocks) const;
    template <class IsLeftOut, class Kept>
    void keep_near(Part& part, PairKind kind, const PairCandidates::Vertices& vertex, double apart,
                   const IsLeftOut& is_left_out, const Kept& kept) const;
    [[nodiscard]] bool some_are_torn() const noexcept;
    void let_heap_stand() noexcept;
    [[nodiscard]] bool make_safe(std::span<const Vec3> start, std::span<const Vec3> end, Workers& workers);
    void end_step(std::span<const Vec3> start, std::span<Vec3> end, Workers& workers);
    void take_ends(std::size_t surface, std::span<const Vec3> start, std::span<Vec3> end) noexcept;
    [[nodiscard]] bool can_move(std::uint32_t vertex) const noexcept;
    [[nodiscard]] bool is_exact(std::uint32_t vertex) const noexcept { return surfaces_[surface_of_[vertex]].exact; }
    [[nodiscard]] bool meets_exact(const PairVertices& v) const noexcept { return is_exact(v[0]) || is_exact(v[3]); }
    [[nodiscard]] bool find_unsafe(bool patches_are_apart = true);
    [[nodiscard]] bool stands_proved(const ListedPairs& pairs, std::size_t at) const noexcept;
    void push_unsafe();
    [[nodiscard]] bool bind_unsafe();
    void find_common_motions();
    void follow_exact();
    template <class Visit>
    void for_each_bound_pair(const Visit& visit);
    void move_bound();
    [[nodiscard]] Sides sides_of(ListedPairs& pairs, std::size_t at) const noexcept;
    void keep_to_sides(ListedPairs& pairs, std::size_t at) noexcept;
    [[nodiscard]] bool have_left_reach() const noexcept;
    [[nodiscard]] std::uint32_t patch_of(std::uint32_t vertex) noexcept;
    [[nodiscard]] bool is_of_one_patch(const PairVertices& vertex) const noexcept;
    [[nodiscard]] bool is_kept_by_planes(const PairVertices& vertex) const noexcept;

    std::vector<SolidSurface> surfaces_;
    std::vector<std::uint32_t> surface_of_;   // per vertex
    FeatureBlocks blocks_;                    // of all, one for each leaf of a tree
    std::vector<std::uint32_t> first_block_;  // per surface
    const FeatureKernels& kernels_;
    bool some_are_exact_ = false;       // surfaces
    double catch_up_speed_;             // m/s
    double least_gap_ = 0.0;            // m
    double touching_ = 0.0;             // m: features that are nearer touch
    double reach_ = 0.0;                // m: how far rounds may move a vertex before pairs are searched again
    double own_apart_ = 0.0;            // m: pairs of one surface that are to be nearer than this are kept
    bool search_is_due_ = true;         // of pairs of two surfaces
    double torn_ = 0.0;                 // m, lag
    double way_if_torn_ = 0.0;          // m, in a step
    std::vector<BodyPair> left_alone_;  // in order
    std::vector<std::uint32_t> meets_;  // surfaces that meet others
    BodySweep sweep_;                   // of these
    std::vector<Bounds> bounds_;        // of these
    double farthest_ = 0.0;             // m, coordinate of these
    std::vector<BodyPair> near_;
    std::vector<Meeting> meeting_;  // meetings_ of them are in use
    std::size_t meetings_ = 0;
    std::vector<BlockPair> block_pairs_;  // of all meetings
    std::vector<std::uint8_t> apart_;     // per pair of blocks
    std::vector<Own> own_;
    std::vector<std::uint32_t> own_of_;  // per surface; kFree: it does not meet itself
    std::vector<Part> parts_;  // one for each of own_, then of pairs of surfaces; part_count_ of them are in use
    std::size_t part_count_ = 0;
    std::vector<std::uint8_t> yields_;        // per surface: its vertices can be pushed
    std::vector<std::uint8_t> stands_;        // per surface, in this step
    std::vector<std::uint8_t> changes_;       // per surface, in this step
    std::vector<double> most_lag_;            // m, per surface
    std::vector<double> ease_;                // per surface: part of the way for which it is asked while it is torn
    std::vector<Vec3> lag_;                   // m, per vertex: from where it is to where its skin would be
    std::vector<std::uint8_t> leaves_alone_;  // per vertex: it touched or crossed its own surface at the start
    SolidSurfaceCounts counts_;
    // Of an attempt, per vertex; known for those of surfaces that take part.
    std::vector<std::uint8_t> takes_part_;  // per surface
    std::vector<Row> start_;                // m
    std::vector<Row> end_;                  // m
    std::vector<std::uint32_t> moved_;      // vertices that rounds have moved
    std::vector<std::uint8_t> is_moved_;    // per vertex
    std::uint64_t round_ = 0;               // of proofs, since construction
    std::vector<std::uint64_t> moved_in_;   // per vertex: the last round after which its end has changed
    // Of these.
    std::vector<Row> asked_;         // m, the end as it was given
    std::vector<Row> searched_;      // m, the end for which pairs were searched
    std::vector<Row> own_searched_;  // m, the same for pairs of one surface
    // Of an attempt, per vertex.
    std::vector<std::uint32_t> parent_;  // the bound vertex that its patch is named after; kFree: not bound
    std::vector<double> part_;           // bound: of the way from where it is led to the end as it was given
    std::vector<Patch> patch_;           // of the vertex that is its own parent
    std::vector<Vec3> led_;              // bound: m, the motion on which its part of the rest is added
    std::vector<Patch::Sum> led_sum_;    // bound: of the motions of exact features that it meets
    std::vector<std::uint32_t> near_blocks_;
    std::vector<std::uint8_t> is_near_;  // per block
    std::vector<std::uint32_t> bound_;
    std::vector<Unsafe> unsafe_;
};

}  // namespace haptic::sim
