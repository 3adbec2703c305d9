// Surfaces of solids that never pass through one another.
//
// The surface of a solid follows its particles: skinning tells where its vertices are to be at the end of a step.
// Contacts of particles keep bodies apart with forces, as ellipsoids. Surfaces differ from these, so two of them may
// be asked to cross. Here each follows as far as it can without.
//
// Invariant: at the end of every step a vertex and a triangle, or two edges, of different solids are at least a small
// gap apart, and on the straight paths that lead there they never touch. So nothing that has not crossed ever crosses.
// Whatever is in the way, the invariant can be kept: where all vertices stand still, or move alike, no gap closes. What
// a surface lags behind its skin it makes up for as soon as there is room, some of it in each step. Particles, forces
// and momenta are not changed by it.
//
// Pairs of features are found by the swept trees of the step and by boxes around the paths (feature_blocks.hpp), for
// two surfaces at a time, and again when these have moved relative to each other by more than a budget: fish that lie
// on one another seldom do. Pairs are then proved apart (feature_pairs.hpp). What would come too near is first pushed
// apart at the ends of its paths, some rounds long. The vertices of what still does are bound: each keeps to its side
// of planes in the middle of the gaps in which it was at the start, one for each pair, and moves as far toward its end
// as these permit. The planes of bound vertices that meet move alike, with the mean motion of these, which is that of
// the surfaces where they lie on one another. A vertex that is alone on its side of a plane needs to know nothing of
// the others, so the bound ones keep their gaps however many there are; what they meet is bound too.
//
// Bodies that cross at the beginning are left to one another until their boxes part.
// @source M. Li et al., "Codimensional Incremental Potential Contact", 2021 (positive distance as invariant); the rest
// is our own
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "collision/body_sweep.hpp"
#include "collision/feature_blocks.hpp"
#include "collision/feature_pairs.hpp"
#include "contact/swept_tree.hpp"
#include "dynamics/constraint_batches.hpp"
#include "dynamics/workers.hpp"
#include "haptic/sim/mesh.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// The surface of a solid, whose vertices are consecutive ones of all.
struct SolidSurface {
    SweptTree* tree = nullptr;  // of the triangles; null: meets no others
    std::span<const Triangle> triangles;
    std::size_t first_vertex = 0;
    std::size_t vertices = 0;
    bool movable = true;  // else its vertices stay where they are
    double floor = 0.0;   // m: no vertex is pushed below this height
};

/// Counts since construction.
struct SolidSurfaceCounts {
    std::uint64_t candidates = 0;  // pairs whose boxes met, of all searches
    std::uint64_t pairs = 0;       // that were near, of all steps
    std::uint64_t unsafe = 0;      // that the skin alone would not have kept apart
    std::uint64_t rounds = 0;      // over unsafe pairs
    std::uint64_t bound = 0;       // vertices, of all steps
    std::uint64_t stood = 0;       // how often surfaces had to stand still
};

class SolidSurfaces {
  public:
    /// `crossing`: those that cross at the beginning. `rest`: vertices of all surfaces, m. Throws std::invalid_argument
    /// for a number of lanes that this machine lacks. Results do not depend on it.
    SolidSurfaces(std::vector<SolidSurface> surfaces, std::span<const Vec3> rest, std::vector<BodyPair> crossing,
                  std::size_t lanes);

    /// m, that is guaranteed.
    [[nodiscard]] double least_gap() const noexcept { return least_gap_; }
    /// Whether two surfaces are kept apart: one of them can be pushed, and they are not left to one another.
    [[nodiscard]] bool keeps_apart(std::uint32_t one, std::uint32_t other) const noexcept;

    /// Takes from the ends of a surface, m, where its skin would be, what it has lagged behind but for so much as it
    /// may catch up in one step. On any thread.
    void ask(std::size_t surface, std::span<Vec3> end) const noexcept;
    /// Changes the ends of the step, m, of all vertices, so that nothing crosses on straight paths from `start` to
    /// `end`. All trees have been refitted to both; those of surfaces that change are again.
    void keep_apart(std::span<const Vec3> start, std::span<Vec3> end, Workers& workers);
    /// Whether a vertex of this surface is not where its skin would be.
    [[nodiscard]] bool lags(std::size_t surface) const noexcept { return lags_[surface] != 0; }

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
    /// The pairs of features that are near each other, of some pairs of blocks.
    struct Part {
        std::array<FeaturePairs, 2> pairs{FeaturePairs(PairKind::VertexTriangle), FeaturePairs(PairKind::EdgeEdge)};
        std::uint64_t candidates = 0;
        // Of the search.
        FeatureBlocks::Comparison comparison;
        FeaturePairs some{PairKind::VertexTriangle};
        FeaturePairs doubtful{PairKind::VertexTriangle};
        NearestOfPairs nearest;

        void make_room();
    };
    /// A pair that may come too near, by its place.
    struct Unsafe {
        std::uint32_t part;
        std::uint32_t list;
        std::uint32_t pair;
    };

    /// Bound vertices that meet.
    struct Patch {
        Vec3 motion{0.0};  // m, in common: the sum over its vertices, then their mean
        double vertices = 0.0;
        double lowest = std::numeric_limits<double>::lowest();  // m: the least way up that keeps all above the floor
        bool stands = false;
    };

    void make_room();
    [[nodiscard]] double farthest_stray() const noexcept;
    void find_meetings(double margin);
    void search(std::span<const Vec3> start, std::span<const Vec3> end, Workers& workers);
    void list_near_blocks();
    void take_part(std::uint32_t vertex, std::span<const Vec3> start, std::span<const Vec3> end);
    void find_blocks(Meeting& meeting, double margin) const;
    void find_pairs(Part& part, std::span<const BlockPair> blocks) const;
    void keep_near(Part& part, PairKind kind, const PairCandidates::Vertices& vertex) const;
    [[nodiscard]] Vec3 left_of(const Vec3& lag) const noexcept;
    [[nodiscard]] bool make_safe(std::span<const Vec3> start, std::span<const Vec3> end, Workers& workers);
    void end_step(std::span<const Vec3> start, std::span<Vec3> end, Workers& workers);
    void take_ends(std::size_t surface, std::span<const Vec3> start, std::span<Vec3> end) noexcept;
    [[nodiscard]] bool can_move(std::uint32_t vertex) const noexcept;
    [[nodiscard]] bool find_unsafe();
    void push_unsafe();
    void bind_unsafe();
    void find_common_motions();
    void move_bound();
    void keep_to_sides(const FeaturePairs& pairs, std::size_t at) noexcept;
    [[nodiscard]] bool have_left_reach() const noexcept;
    [[nodiscard]] std::uint32_t patch_of(std::uint32_t vertex) noexcept;
    [[nodiscard]] bool is_of_one_patch(const FeaturePairs& pairs, std::size_t at) noexcept;

    std::vector<SolidSurface> surfaces_;
    std::vector<std::uint32_t> surface_of_;  // per vertex
    FeatureBlocks blocks_;
    std::vector<std::uint32_t> first_block_;  // per surface
    const FeatureKernels& kernels_;
    double least_gap_ = 0.0;            // m
    double catch_up_ = 0.0;             // m, in a step
    double reach_ = 0.0;                // m: how far rounds may move a vertex before pairs are searched again
    std::vector<BodyPair> left_alone_;  // in order
    BodySweep sweep_;
    std::vector<Bounds> bounds_;  // per surface
    double farthest_ = 0.0;       // m, coordinate of these
    std::vector<BodyPair> near_;
    std::vector<Meeting> meeting_;  // the first so many
    std::size_t meetings_ = 0;
    std::vector<BlockPair> block_pairs_;  // of all meetings
    std::vector<std::uint8_t> apart_;     // per pair of blocks
    std::vector<Part> parts_;             // the first so many
    std::size_t part_count_ = 0;
    std::vector<std::uint8_t> lags_;     // per surface
    std::vector<std::uint8_t> stands_;   // per surface, in this step
    std::vector<std::uint8_t> changes_;  // per surface, in this step
    std::vector<Vec3> lag_;              // m, per vertex: from where it is to where its skin would be
    SolidSurfaceCounts counts_;
    // Of the step, per vertex; known for those of blocks that take part.
    std::vector<Row> start_;                  // m
    std::vector<Row> asked_;                  // m, where the skin would be
    std::vector<Row> end_;                    // m
    std::vector<Row> searched_;               // m, the end for which pairs were searched
    std::vector<std::uint32_t> parent_;       // a bound vertex of the same patch; kFree: not bound
    std::vector<double> part_;                // bound: of the way from where the patch leads to where the skin would be
    std::vector<Patch> patch_;                // of the vertex that is its own parent
    std::vector<std::uint32_t> taking_part_;  // vertices
    std::vector<std::uint8_t> takes_part_;    // per vertex
    std::vector<std::uint32_t> near_blocks_;
    std::vector<std::uint8_t> is_near_;  // per block
    std::vector<std::uint32_t> bound_;
    std::vector<Unsafe> unsafe_;
};

}  // namespace haptic::sim
