// Pairs of features of one surface that may come near one another in a step.
//
// Each part of a surface moves almost as a rigid body does, so its features keep their distances, whatever way they go.
// So a pair is looked at only when the motion of its surroundings has used up the distance that it had when it was last
// looked at.
//
// The motion of a block over a step is that of a frame, x + way + turn x (x - centre), and a rest. Frames bring nothing
// nearer on straight paths, because |d + s turn x d| >= |d|. So the distance of two points shrinks by no more than what
// any one frame leaves of their motions.
//
// Blocks that are near one another have a list of those features of theirs that are nearer than a reach. Motions, in
// the frame of either block, use up these distances, and the reach. Most of them go to and fro. So when the reach is
// used up, corners of both blocks are compared with where they were when the list was made: a pair that is not in it
// has come nearer by no more than twice what one rotation and one way leave of the motion of a corner, and the list
// lasts on if that is little. Else it is made again.
//
// Blocks that are far from one another use up their distance in the frame of the whole surface. Those that are beyond a
// horizon are not listed; all are searched again when some have come to it.
// @source our own; lists that are kept until something has moved far enough: L. Verlet, "Computer Experiments on
// Classical Fluids I", 1967
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
#include "haptic/types.hpp"
#include "simd/features.hpp"
#include "simd/lanes.hpp"

namespace haptic::sim {

class OwnPairs {
  public:
    /// Of a surface in blocks, which all functions get. `edge`: m, the mean length of its edges.
    OwnPairs(const FeatureBlocks& blocks, double edge);

    /// Takes the motion over a step: rows of all vertices, m.
    void take_motion(const FeatureBlocks& blocks, const Row* start, const Row* end);
    /// The same where these vertices alone go another way: what follows is of blocks that have some of them.
    void take_motion_of(std::span<const std::uint32_t> vertices, const FeatureBlocks& blocks, const Row* start,
                        const Row* end);
    /// Finds the near blocks whose features are to be listed, from their places at the start of the motion, with
    /// begin_list(), list() and end_list(), and those to be compared over it. `apart`: m, as in find_due().
    void find_near(const FeatureBlocks& blocks, double apart);
    /// Pairs of one kind.
    struct Due {
        struct Place {
            std::uint32_t near;
            std::uint32_t feature;
        };
        PairCandidates vertices;
        std::vector<Place> place;
    };
    /// Finds the listed pairs that may come nearer than `apart`, m, over the motion: of vertices and triangles, then of
    /// edges.
    void find_due(const FeatureBlocks& blocks, double apart, std::array<Due, 2>& due);
    /// A listed pair is this far apart, m, at the start of the motion.
    void set_distance(const Due::Place& place, double distance) noexcept;
    /// The motion has been made.
    void advance() noexcept;

    /// Room for lists that are longer than now, so that steps need not allocate.
    void make_room_for_more();

    /// Near blocks, by number.
    [[nodiscard]] std::span<const std::uint32_t> to_list() const noexcept { return to_list_; }
    /// The same for those whose motion is so great that a list would not last: any of their features may come near.
    [[nodiscard]] std::span<const std::uint32_t> to_compare() const noexcept { return to_compare_; }
    [[nodiscard]] std::array<std::uint32_t, 2> blocks_of(std::uint32_t near) const noexcept {
        return {near_[near].first, near_[near].second};
    }
    /// Whether the motion of either block was taken last.
    [[nodiscard]] bool is_new(std::uint32_t near) const noexcept {
        return (is_new_[near_[near].first] | is_new_[near_[near].second]) != 0;
    }
    /// m, around the features of a block, in which those of others are listed.
    [[nodiscard]] double margin_of(std::uint32_t block) const noexcept { return margin_[block]; }
    void begin_list(std::uint32_t near, const FeatureBlocks& blocks) noexcept;
    /// Features that are farther apart than the reach are left out.
    void list(std::uint32_t near, PairKind kind, const PairVertices& vertex, double distance);
    void end_list(std::uint32_t near, const FeatureBlocks& blocks);

  private:
    /// x, y, z and 0.
    using Four = LaneTypes<4, float>::Real;
    /// Of a vertex, from the middle of the surface, and beyond the way of that.
    struct Corner {
        Four place{};  // m, at the start
        Four way{};    // m
    };
    /// Of a block, over a step, in the same frame.
    struct Motion {
        Four centre{};            // m, at the start
        Four way{};               // m
        Four turn{};              // rad
        Four low{};               // m, box of the corners at the start
        Four high{};              // m
        double rest = 0.0;        // m, what the frame of the block leaves of the way of a corner, at most
        double radius = 0.0;      // m, of the corners about the centre
        double in_surface = 0.0;  // m, way of a corner in the frame of the surface, at most
    };
    static constexpr std::uint32_t kNone = 0xffff'ffff;
    /// A pair of features by corners, of the first block and then of the second.
    using Feature = std::array<std::uint8_t, 4>;
    static_assert(6 * FeatureBlocks::kMaxInBlock <= std::numeric_limits<std::uint8_t>::max());
    /// Two blocks near one another, or a block with itself.
    struct Near {
        std::uint32_t first = 0;
        std::uint32_t second = 0;
        float used = std::numeric_limits<float>::infinity();  // m, since its list was made
        float motion = 0.0F;                                  // m, of the step
        float reach = 0.0F;  // m: features that are not listed come near when so much is used
        float next = std::numeric_limits<float>::infinity();  // m, the least `until` of its list; infinite: no pair
    };
    /// Pairs of features that are looked at together.
    static constexpr std::uint32_t kGroup = 8;
    struct alignas(64) PairGroup {
        std::array<float, kGroup> until;  // m, what is used when they may meet; infinite: no pair
        std::array<Feature, kGroup> feature;
    };
    /// Its list: groups of pairs of vertices and triangles, then of edges.
    struct List {
        std::uint32_t begin = 0;
        std::uint32_t edges = 0;
        std::uint32_t end = 0;
        std::uint32_t room = 0;
        // When it was made: features that were farther apart than this, m, are not in it, the orientation of the first
        // block, and the places of the corners of both in `then_`.
        float listed = 0.0F;
        std::uint32_t then = kNone;
        Quat orientation{1.0, 0.0, 0.0, 0.0};
    };
    /// Pairs of one kind that are to be listed.
    struct Listed {
        std::vector<float> until;
        std::vector<Feature> feature;
    };
    struct Far {
        std::uint32_t first;
        std::uint32_t second;
        double until;  // m, the paths of both when they may have come near
    };

    void take_corner(std::uint32_t vertex, const Row* start, const Row* end) noexcept;
    void fit_motion(std::uint32_t block, const FeatureBlocks& blocks) noexcept;
    void find_frame() noexcept;
    void find_motions() noexcept;
    void search(double apart);
    void make_room(std::uint32_t groups);
    void add_near(std::uint32_t first, std::uint32_t second);
    template <class Visit>
    void for_each_corner(std::uint32_t near, const FeatureBlocks& blocks, const Visit& visit) const;
    void forget_list(std::uint32_t near, double reach) noexcept;
    void fetch_corners(std::uint32_t near) const noexcept;
    void keep_corners(std::uint32_t near, const FeatureBlocks& blocks);
    [[nodiscard]] double farthest_from_list(std::uint32_t near, const FeatureBlocks& blocks) const noexcept;
    struct GroupInTurn {
        std::uint32_t near;
        std::uint32_t group;
        float then;  // m, used when the motion has been made
    };
    void take_due(const GroupInTurn& in_turn, const FeatureBlocks& blocks, Due& due);
    void write_list(const Listed& listed, float reach, std::uint32_t begin, std::uint32_t end) noexcept;
    [[nodiscard]] double motion_between(std::uint32_t first, std::uint32_t second) const noexcept;
    [[nodiscard]] double distance_of_boxes(std::uint32_t first, std::uint32_t second) const noexcept;

    double least_reach_;                     // m
    double horizon_ = 0.0;                   // m
    Vec3 middle_{0.0};                       // m, of the surface
    Vec3 way_{0.0};                          // m, of that
    Four turn_{};                            // rad, of the surface
    Four frame_way_{};                       // m, of its middle, beyond that
    std::vector<Corner> corner_;             // per vertex
    std::vector<Motion> motion_;             // per block
    std::vector<Quat> orientation_;          // per block, since the start
    std::vector<std::uint8_t> is_new_;       // per block: its motion was taken last
    bool is_first_motion_ = true;            // of an attempt: that of all blocks was taken last
    std::uint32_t first_vertex_ = 0;         // of the corners
    std::vector<std::uint32_t> first_of_;    // per vertex, and after the last one: in has_corner_
    std::vector<std::uint32_t> has_corner_;  // blocks
    std::vector<double> path_;               // m, per block, in the frame of the surface, since the last search
    double longest_path_ = 0.0;              // m, of these, with the motion
    double longest_motion_ = 0.0;            // m
    double rounding_of_places_ = 0.0;        // m, what floats may take from a distance
    double rounding_ = 0.0;                  // m, and from the motion between two blocks
    std::vector<Near> near_;
    std::vector<List> list_;  // of these
    std::vector<PairGroup> group_;
    std::vector<float> least_of_group_;     // m, the least `until` of each
    std::uint32_t free_ = 0;                // of these: from here on no list has room
    std::size_t most_corners_ = 0;          // of two blocks
    std::vector<Four> then_;                // m, corners of near blocks when they were listed, from their middle
    std::vector<std::uint32_t> free_then_;  // places in these that no near blocks have
    std::vector<Far> far_;
    double far_next_ = 0.0;  // m, the least of their `until`
    std::vector<std::uint32_t> to_list_;
    std::vector<std::uint32_t> to_compare_;
    std::vector<double> margin_;  // m, per block
    // Of the search, and of the list that is being made.
    std::array<Listed, 2> new_;
    std::vector<std::uint8_t> corner_index_;  // per vertex, of those of both blocks
    std::array<std::vector<GroupInTurn>, 2> groups_;
    std::vector<std::uint32_t> in_turn_;  // near blocks
    std::vector<std::uint32_t> order_;    // of near blocks, by the places of their lists
    std::vector<std::uint64_t> known_;    // near blocks, in order
    BodySweep sweep_;                     // of blocks
    std::vector<Bounds> bounds_;
    std::vector<BodyPair> found_;
};

}  // namespace haptic::sim
