// Pairs of features of one surface that may come near one another in a step.
//
// Each part of a surface deforms smoothly, so its features keep their distances but for what an affine map shortens
// and what it leaves (deformation.hpp). Each block of features has surroundings: itself and those later ones that are
// near it. When its list is made, the surroundings as they are become its reference, and pairs of features in it that
// are nearer than a reach are listed with their distances. From then on an affine map is fitted to what of them is
// within that reach of the block, so that bending leaves little where it counts. A listed pair is due, to be proved
// apart by itself, only where the map and the residuals of its corners do not prove it. When that is so for many,
// distances are taken again; when what is not listed may come near, the list is made again. Where a motion is so fast
// that a list would not last, all features of the surroundings are compared over it.
//
// How much nearer all pairs of surroundings that are not due may come is their room. Until motions have used it up,
// beyond what is common to the whole surface, nothing has to be fitted. So what is quiet costs next to nothing.
//
// Blocks that are far from one another keep their distances in the same way, with the whole surface as surroundings.
// Those that are beyond a horizon are not listed; all are searched again when some may have come near.
// @source our own; lists that are kept until something has moved far enough: L. Verlet, "Computer Experiments on
// Classical Fluids I", 1967
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "collision/body_sweep.hpp"
#include "collision/deformation.hpp"
#include "collision/feature_blocks.hpp"
#include "collision/feature_pairs.hpp"
#include "haptic/types.hpp"
#include "simd/features.hpp"
#include "simd/lanes.hpp"

namespace haptic::sim {

/// Entries with a distance, m, roughly in the order of that. They lie elsewhere.
class OrderOfDistance {
  public:
    [[nodiscard]] std::size_t size() const noexcept { return begin_.back(); }
    /// Copies entries in order. Most of them are nearer than `reach`.
    template <class Entry>
    void arrange(std::span<const Entry> entries, float reach, Entry* to) noexcept;
    /// The number of first entries among which are all that are nearer than a limit, m.
    [[nodiscard]] std::uint32_t count_within(float limit) const noexcept;

  private:
    static constexpr std::size_t kBuckets = 16;
    std::array<std::uint32_t, kBuckets + 1> begin_{};  // of each bucket
    float width_ = 1.0F;                               // m, of a bucket
};

class OwnPairs {
  public:
    /// Of a surface in blocks, which all functions get. `edge`: m, the mean length of its edges.
    OwnPairs(const FeatureBlocks& blocks, const DeformationKernels& kernels, double edge);

    /// Takes the motion over a step, which starts where the last one that was made has ended: rows of all vertices, m.
    /// `apart`: m, as in all that follows: features that may come nearer are found.
    void take_motion(const FeatureBlocks& blocks, const Row* start, const Row* end, double apart);
    /// The same where these vertices alone go another way. find() then visits only surroundings that have some of them.
    void take_motion_of(std::span<const std::uint32_t> vertices, const FeatureBlocks& blocks, const Row* end,
                        double apart);
    /// Pairs of one kind, and the blocks in whose surroundings they are.
    struct Due {
        PairCandidates pairs;
        std::vector<std::uint32_t> block;  // per pair
        void make_room(std::size_t count);
    };
    /// Finds the listed pairs that may come too near over the motion, of vertices and triangles, then of edges, the
    /// blocks whose features are to be listed, from their places at the start of the motion, with begin_list(), list()
    /// and end_list(), and those to be compared over it.
    void find(double apart, std::array<Due, 2>& due);
    /// The motion has been made.
    void advance() noexcept;

    /// Room for lists that are longer than now, so that steps need not allocate.
    void make_room_for_more();

    [[nodiscard]] std::span<const std::uint32_t> to_list() const noexcept { return to_list_; }
    /// Those whose motion is so great that a list does not last: any features of their surroundings may come near.
    [[nodiscard]] std::span<const std::uint32_t> to_compare() const noexcept { return to_compare_; }
    /// The surroundings of a block: itself and later ones.
    [[nodiscard]] std::span<const std::uint32_t> near(std::uint32_t block) const noexcept {
        return surroundings_[block].blocks;
    }
    /// Whether the motion of a block's surroundings was taken last.
    [[nodiscard]] bool is_new(std::uint32_t block) const noexcept { return surroundings_[block].is_new; }
    /// m: features of surroundings that are farther apart are not listed.
    [[nodiscard]] double reach() const noexcept { return reach_; }

    void begin_list(std::uint32_t block, const FeatureBlocks& blocks);
    /// Whether all that is to be listed is in the list already, so that only distances are to be taken again.
    [[nodiscard]] bool is_complete(std::uint32_t block) const noexcept { return surroundings_[block].is_complete; }
    /// Adds the listed pairs.
    void take_listed(std::uint32_t block, std::array<PairCandidates, 2>& listed) const;
    /// Features that are farther apart than the reach are left out.
    void list(PairKind kind, const PairVertices& vertex, double distance);
    void end_list(std::uint32_t block, const FeatureBlocks& blocks, double apart, std::array<Due, 2>& due);

  private:
    /// x, y, z and 0.
    using Four = LaneTypes<4, float>::Real;
    /// Of a block's corners at one end of the step, from an origin of the surface.
    struct Box {
        Four low{};   // m
        Four high{};  // m
    };
    struct Places {
        std::vector<FloatRow> vertex;  // m, from an origin of the surface
        std::vector<Box> box;          // per block
    };
    /// A pair of features by corners of surroundings, of the first feature and then of the second.
    using Feature = std::array<std::uint16_t, 4>;
    struct FeatureEntry {
        float distance;  // m, when the reference was taken
        Feature feature;
    };
    struct FarEntry {
        float distance;  // m, when the reference of the whole surface was taken; infinite: not far any more
        BodyPair blocks;
    };
    /// In `entry_`.
    struct List {
        std::uint32_t begin = 0;
        std::uint32_t room = 0;
        OrderOfDistance order;
    };
    struct Surroundings {
        std::vector<std::uint32_t> blocks;  // in order
        Deformation deformation;            // of their corners, those of the first block before those of others
        float unlisted_distance = 0.0F;     // m: what is not listed is farther apart, over the motion
        float room = 0.0F;                  // m, by which all pairs may come nearer after that; negative: some are due
        float used = 0.0F;                  // m, of the room by motions that it did not follow
        std::size_t work = 0;               // pairs that were due since the reference was taken
        bool is_listed = false;
        bool is_complete = false;
        bool is_new = true;         // its motion was taken last
        bool is_followed = false;   // over the motion
        std::array<List, 2> lists;  // of vertices and triangles, then of edges
    };

    [[nodiscard]] static float rounding_in(const Box& box) noexcept;
    void place(std::uint32_t vertex, const Row* position, Places& places) noexcept;
    void fit_box(std::uint32_t block, const FeatureBlocks& blocks, Places& places) noexcept;
    void find_deviations(const FeatureBlocks& blocks);
    void follow_whole(const FeatureBlocks& blocks, double apart);
    [[nodiscard]] bool horizon_holds(float stretch, float apart) const noexcept;
    void find_due_blocks(float stretch, float apart);
    void search();
    void surround(std::uint32_t block, std::span<const std::uint32_t> by);
    void prefetch(const Surroundings& of) const noexcept;
    void make_room(std::size_t entries);
    void write_list(List& list, std::span<const FeatureEntry> entries);
    [[nodiscard]] bool new_list_would_last(const Surroundings& of, double apart) const noexcept;
    [[nodiscard]] float deviation_between(const Surroundings& of) const noexcept;
    void compare(std::uint32_t block);
    [[nodiscard]] bool list_lasts(std::uint32_t block, double apart);
    void take_due(std::uint32_t block, double apart, std::array<Due, 2>& due);
    void add(const Surroundings& of, const Feature& feature, PairCandidates& to) const noexcept;
    void measure(Surroundings& of, const FeatureBlocks& blocks, float listed);
    [[nodiscard]] static float distance_between(const Box& a, const Box& b) noexcept;
    [[nodiscard]] float distance_of_boxes(std::uint32_t first, std::uint32_t second) const noexcept;
    [[nodiscard]] bool boxes_stay_apart(std::uint32_t first, std::uint32_t second, float gap) const noexcept;

    const DeformationKernels& kernels_;
    double reach_;                           // m
    float greatest_room_;                    // m
    std::uint32_t first_vertex_ = 0;         // of the surface
    std::vector<std::uint32_t> first_of_;    // per vertex, and after the last one: in has_corner_
    std::vector<std::uint32_t> has_corner_;  // blocks
    Places start_;
    Places end_;
    Vec3 origin_{0.0};  // m, of the end
    bool is_placed_ = false;
    bool is_first_motion_ = true;  // of an attempt: that of all blocks was taken last
    float rounding_ = 0.0F;        // m, what floats may take from a distance
    std::vector<Surroundings> surroundings_;
    std::vector<FeatureEntry> entry_;
    std::size_t free_ = 0;                // of these: from here on no list has room
    std::vector<List*> in_order_;         // lists, by their places
    std::vector<std::uint8_t> is_moved_;  // per block: its motion was taken last
    // Of the whole surface.
    Deformation whole_;
    std::vector<float> most_;       // m, per block: residual
    std::vector<float> deviation_;  // m, per block: from the motion of a frame
    std::vector<float> deviation_of_vertex_;
    std::vector<FarEntry> far_;
    OrderOfDistance order_of_far_;
    float horizon_ = 0.0F;  // m: blocks that are farther apart, when the reference was taken, are not listed
    std::size_t far_work_ = 0;
    std::vector<std::uint32_t> in_turn_;  // blocks
    std::vector<std::uint32_t> to_list_;
    std::vector<std::uint32_t> to_compare_;
    // Of the surroundings that are looked at.
    Deformation::Residuals residuals_;
    float stretch_ = 0.0F;                // least, over the motion
    std::vector<std::uint32_t> corners_;  // those of the list that is being made, by their vertices
    std::size_t corners_of_first_ = 0;    // the first of these, of the first block
    std::size_t fitted_corners_ = 0;      // and with others that are near it
    std::vector<std::uint32_t> far_corners_;
    std::vector<float> distance_;           // m, per corner
    std::vector<std::uint16_t> corner_of_;  // per vertex
    std::vector<std::uint8_t> is_corner_;   // per vertex
    std::array<std::vector<FeatureEntry>, 2> new_;
    std::vector<FarEntry> new_far_;
    std::vector<std::uint32_t> new_near_;
    BodySweep sweep_;  // of blocks
    std::vector<Bounds> bounds_;
    std::vector<BodyPair> found_;
};

template <class Entry>
void OrderOfDistance::arrange(std::span<const Entry> entries, float reach, Entry* to) noexcept {
    width_ = reach / static_cast<float>(kBuckets);
    const auto bucket_of = [&](const Entry& of) {
        return static_cast<std::size_t>(std::min(of.distance / width_, static_cast<float>(kBuckets - 1)));
    };
    begin_.fill(0);
    for (const Entry& of : entries) {
        ++begin_[bucket_of(of) + 1];
    }
    for (std::size_t k = 1; k < begin_.size(); ++k) {
        begin_[k] += begin_[k - 1];
    }
    std::array<std::uint32_t, kBuckets + 1> next = begin_;
    for (const Entry& of : entries) {
        to[next[bucket_of(of)]++] = of;
    }
}

inline std::uint32_t OrderOfDistance::count_within(float limit) const noexcept {
    // Rounding may have put some into the next bucket.
    return begin_[static_cast<std::size_t>(std::clamp(limit / width_ + 1.001F, 0.0F, static_cast<float>(kBuckets)))];
}

}  // namespace haptic::sim
