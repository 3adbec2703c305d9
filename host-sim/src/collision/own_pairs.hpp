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
// the frame of either block, use up these distances, and the reach, after which the list is made again. Blocks that are
// far from one another use up their distance in the frame of the whole surface. Those that are beyond a horizon are not
// listed; all are searched again when some have come to it.
// @source our own; lists that are kept until something has moved far enough: L. Verlet, "Computer Experiments on
// Classical Fluids I", 1967
#pragma once

#include <algorithm>
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
#include "haptic/types.hpp"
#include "simd/features.hpp"

namespace haptic::sim {

class OwnPairs {
  public:
    /// Of so many blocks, the surface's, from `first_block` on. `edge`: m, the mean length of its edges.
    OwnPairs(const FeatureBlocks& blocks, std::uint32_t first_block, std::uint32_t count, double edge);

    /// Takes the motion over a step: path_of(vertex) is a pair of places, m.
    template <class PathOf>
    void take_motion(const FeatureBlocks& blocks, const PathOf& path_of);
    /// The same where these vertices alone go another way: what follows is of blocks that have some of them.
    template <class PathOf>
    void take_motion_of(std::span<const std::uint32_t> vertices, const FeatureBlocks& blocks, const PathOf& path_of);
    /// Finds the near blocks whose features are to be listed, from their places at the start of the motion, with
    /// begin_list(), list() and end_list(), and those to be compared over it. `apart`: m, as in find_due().
    void find_near(double apart);
    /// Calls due(near blocks, feature, kind, vertices) for each listed pair that may come nearer than `apart`, m, over
    /// the motion.
    template <class Due>
    void find_due(double apart, const Due& due);
    /// A listed pair is this far apart, m, at the start of the motion.
    void set_distance(std::uint32_t near, std::uint32_t feature, double distance) noexcept;
    /// The motion has been made.
    void advance() noexcept;

    /// Room for lists that are longer than now, so that steps need not allocate.
    void make_room_for_more();

    /// Near blocks, by number.
    [[nodiscard]] std::span<const std::uint32_t> to_list() const noexcept { return to_list_; }
    /// The same for those whose motion is so great that a list would not last: any of their features may come near.
    [[nodiscard]] std::span<const std::uint32_t> to_compare() const noexcept { return to_compare_; }
    [[nodiscard]] std::array<std::uint32_t, 2> blocks_of(std::uint32_t near) const noexcept {
        return {first_block_ + near_[near].first, first_block_ + near_[near].second};
    }
    /// Whether the motion of either block was taken last.
    [[nodiscard]] bool is_new(std::uint32_t near) const noexcept {
        return (is_new_[near_[near].first] | is_new_[near_[near].second]) != 0;
    }
    /// m, around the features of a block, in which those of others are listed.
    [[nodiscard]] double margin_of(std::uint32_t block) const noexcept { return margin_[block - first_block_]; }
    void begin_list(std::uint32_t near) noexcept;
    /// Features that are farther apart than the reach are left out.
    void list(std::uint32_t near, PairKind kind, const PairVertices& vertex, double distance);
    void end_list(std::uint32_t near);

  private:
    /// Of a block, over a step.
    struct Motion {
        Vec3 centre{0.0};         // m, at the start
        Vec3 way{0.0};            // m
        Vec3 turn{0.0};           // rad
        double rest = 0.0;        // m, what the frame leaves of the way of a corner, at most
        double radius = 0.0;      // m, of the corners about the centre
        double in_surface = 0.0;  // m, way of a corner in the frame of the surface, at most
        Vec3 low{0.0};            // m, box of the corners at the start
        Vec3 high{0.0};           // m
    };
    /// Corners of a block, from the first of them on, which is also repeated up to whole vectors.
    struct Corners {  // NOLINT(cppcoreguidelines-pro-type-member-init): written before they are read
        static constexpr std::size_t kLanes = 4;
        static constexpr std::size_t kLength = 3 * FeatureBlocks::kMaxInBlock;
        static_assert(kLength % kLanes == 0);
        float start[3][kLength];  // m
        float way[3][kLength];    // m
        std::size_t count = 0;
        /// With those that fill the last vector.
        [[nodiscard]] std::size_t whole() const noexcept { return (count + kLanes - 1) / kLanes * kLanes; }
        Vec3 first{0.0};      // m
        Vec3 first_way{0.0};  // m
    };
    struct Feature {
        PairVertices vertex;
        PairKind kind;
    };
    /// Two blocks near one another, or a block with itself.
    struct Near {
        std::uint32_t first = 0;
        std::uint32_t second = 0;
        double reach = 0.0;   // m, of the list
        double used = 0.0;    // m, since it was made
        double next = 0.0;    // m, the least of `until`
        double motion = 0.0;  // m, of the step
        // The list, in until_ and feature_.
        std::uint32_t begin = 0;
        std::uint32_t size = 0;
        std::uint32_t room = 0;
    };
    struct Far {
        std::uint32_t first;
        std::uint32_t second;
        double until;  // m, the paths of both when they may have come near
    };

    template <class PathOf>
    void take_motion_of_block(std::uint32_t block, const FeatureBlocks& blocks, const PathOf& path_of) noexcept;
    static void fit_motion(Motion& motion, const Corners& corners) noexcept;
    void find_frame() noexcept;
    void find_motions() noexcept;
    void search(double apart);
    void make_room(std::uint32_t features);
    void add_near(std::uint32_t first, std::uint32_t second);
    [[nodiscard]] double motion_between(std::uint32_t first, std::uint32_t second) const noexcept;
    [[nodiscard]] double distance_of_boxes(std::uint32_t first, std::uint32_t second) const noexcept;

    std::uint32_t first_block_;
    double least_reach_;                     // m
    double horizon_ = 0.0;                   // m
    Motion frame_;                           // of the surface
    std::vector<Motion> motion_;             // per block
    std::vector<std::uint8_t> is_new_;       // per block: its motion was taken last
    std::uint32_t first_vertex_ = 0;         // of the corners
    std::vector<std::uint32_t> first_of_;    // per vertex, and after the last one: in has_corner_
    std::vector<std::uint32_t> has_corner_;  // blocks
    std::vector<double> path_;               // m, per block, in the frame of the surface, since the last search
    double longest_path_ = 0.0;              // m, of these, with the motion
    double longest_motion_ = 0.0;            // m
    std::vector<Near> near_;
    std::vector<double> until_;  // m, per listed pair of features: what is used when they may meet
    std::vector<Feature> feature_;
    std::uint32_t free_ = 0;  // of both: from here on no list has room
    std::vector<Far> far_;
    std::vector<std::uint32_t> to_list_;
    std::vector<std::uint32_t> to_compare_;
    std::vector<double> margin_;  // m, per block
    // Of the search, and of the list that is being made.
    std::vector<double> new_until_;
    std::vector<Feature> new_feature_;
    std::vector<std::uint32_t> order_;  // of near blocks, by the places of their lists
    std::vector<std::uint64_t> known_;  // near blocks, in order
    BodySweep sweep_;                   // of blocks
    std::vector<Bounds> bounds_;
    std::vector<BodyPair> found_;
};

template <class PathOf>
void OwnPairs::take_motion(const FeatureBlocks& blocks, const PathOf& path_of) {
    for (std::uint32_t k = 0; k < motion_.size(); ++k) {
        take_motion_of_block(k, blocks, path_of);
    }
    std::ranges::fill(is_new_, std::uint8_t{1});
    find_frame();
    find_motions();
}

template <class PathOf>
void OwnPairs::take_motion_of(std::span<const std::uint32_t> vertices, const FeatureBlocks& blocks,
                              const PathOf& path_of) {
    std::ranges::fill(is_new_, std::uint8_t{0});
    for (const std::uint32_t v : vertices) {
        for (std::uint32_t k = first_of_[v - first_vertex_]; k < first_of_[v - first_vertex_ + 1]; ++k) {
            if (std::exchange(is_new_[has_corner_[k]], std::uint8_t{1}) == 0) {
                take_motion_of_block(has_corner_[k], blocks, path_of);
            }
        }
    }
    find_motions();
}

template <class PathOf>
void OwnPairs::take_motion_of_block(std::uint32_t block, const FeatureBlocks& blocks, const PathOf& path_of) noexcept {
    const std::span<const std::uint32_t> corner = blocks.corners_of(first_block_ + block);
    Corners corners;  // NOLINT(cppcoreguidelines-pro-type-member-init): written before it is read
    corners.count = corner.size();
    for (std::size_t c = 0; c < corners.whole(); ++c) {
        const auto& [from, to] = path_of(corner[c < corner.size() ? c : 0]);
        if (c == 0) {
            corners.first = from;
            corners.first_way = to - from;
        }
        const Vec3 start = from - corners.first;
        const Vec3 way = (to - from) - corners.first_way;
        for (int axis = 0; axis < 3; ++axis) {
            corners.start[axis][c] = static_cast<float>(start[axis]);
            corners.way[axis][c] = static_cast<float>(way[axis]);
        }
    }
    fit_motion(motion_[block], corners);
}

template <class Due>
void OwnPairs::find_due(double apart, const Due& due) {
    for (std::uint32_t n = 0; n < near_.size(); ++n) {
        Near& near = near_[n];
        const double then = near.used + near.motion + apart;
        if (near.next > then || !is_new(n)) {
            continue;
        }
        near.next = std::numeric_limits<double>::infinity();
        for (std::uint32_t f = near.begin; f < near.begin + near.size; ++f) {
            near.next = std::min(near.next, until_[f]);
            if (until_[f] <= then) {
                due(n, f, feature_[f].kind, feature_[f].vertex);
            }
        }
    }
}

}  // namespace haptic::sim
