// Broad phase: pairs of particles of different bodies whose boxes overlap.
//
// First bodies (body_sweep.hpp). Then, for each two bodies, the particles of each that reach into the box of the other,
// one against the other; where these are many, in order along an axis, so that each meets only those next to it. Boxes
// are compared as numbers of 32 bits, rounded, which loses no pair; what is left is compared exactly.
//
// The search is made with widened boxes, and what it finds is kept until a particle's box leaves its widened one (L.
// Verlet, 1967): bodies that touch move little in a sub-step. A pair that has a gap, between its boxes or, as the
// caller finds, beside a plane, is left alone until both have moved by as much. All others whose present boxes overlap
// come in the order of the particles.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "collision/body_sweep.hpp"
#include "dynamics/constraint_batches.hpp"
#include "haptic/sim/particles.hpp"
#include "simd/collider_rows.hpp"

namespace haptic::sim {

class NearPairs {
  public:
    /// Two bodies, or a particle of each.
    using Pair = BodyPair;

    /// `bodies` hold all particles. Allocates for `capacity` pairs of particles.
    NearPairs(std::vector<ParticleRange> bodies, std::size_t capacity, const ColliderKernels& kernels);

    /// Finds the pairs of bodies whose boxes overlap, one box per body.
    std::span<const Pair> find_bodies(std::span<const Bounds> box);
    /// Finds the pairs of particles of these bodies, from the rows kLow, kHigh, kTravel and kTravelToEnd. Those without
    /// a size or with numbers beyond kMaxCoordinate have none. `near`, per particle: 0 where no other body is, hence no
    /// pair; empty: not known.
    void find_particles(const ColliderRows& rows, std::span<const std::int64_t> near = {});
    /// Those of the k-th pair of bodies, in ascending order: the first is of the first body. Without those that are
    /// still apart.
    [[nodiscard]] std::span<const Pair> particles(std::size_t k) const noexcept {
        return std::span(pair_).subspan(range_[k].begin, range_[k].end - range_[k].begin);
    }
    /// One of them is apart by a gap, m, beyond what it may move in this sub-step.
    void set_apart(const Pair& pair, double gap, const ColliderRows& rows) noexcept {
        apart_until_[place_[static_cast<std::size_t>(&pair - pair_.data())]] = travel_until(pair, gap, rows);
    }
    /// Number of pairs of particles for which there was no room.
    [[nodiscard]] std::size_t dropped() const noexcept { return dropped_; }

    // m: beyond any scene; arithmetic with it stays finite.
    static constexpr double kMaxCoordinate = 1e12;

  private:
    /// Boxes in rows: low x, y, z, then high.
    static constexpr std::size_t kRows = 6;
    struct Boxes {
        explicit Boxes(std::size_t size);
        void set(std::size_t at, const Boxes& from, std::size_t index) noexcept;
        [[nodiscard]] BoxRows rows() const noexcept;
        std::size_t length = 0;
        LaneArray<float> number;
    };
    /// A rounded box; the fourth numbers are 0. One that holds nothing begins after its end.
    struct alignas(32) Box {
        float low[4];
        float high[4];
    };
    struct Scratch {
        explicit Scratch(std::size_t largest_body);
        std::vector<std::uint32_t> outer;  // particles of the first body
        std::vector<std::uint32_t> inner;  // and of the second
        std::vector<std::uint32_t> hits;   // places in `inner`
        std::vector<std::pair<float, std::uint32_t>> order;
        Boxes boxes;  // of `inner`
    };

    void round_boxes(const ColliderRows& rows) noexcept;
    [[nodiscard]] bool are_within_wide(std::span<const std::int64_t> near) const noexcept;
    void search(float margin);
    void search_bodies(const Pair& bodies);
    void choose(const ColliderRows& rows);
    /// m: as far as both may travel until a gap of now is closed.
    [[nodiscard]] static double travel_until(const Pair& pair, double gap, const ColliderRows& rows) noexcept {
        const auto travel = [&](std::uint32_t particle) {
            return rows[collider_row::kTravel][particle] + rows[collider_row::kSlack][particle];
        };
        return gap + travel(pair.first) + travel(pair.second);
    }
    [[nodiscard]] RoundedBox around(const std::vector<std::uint32_t>& particles, std::size_t count) const;
    [[nodiscard]] std::size_t reaching_into(const RoundedBox& box, const ParticleRange& body,
                                            std::vector<std::uint32_t>& particles) const;

    const ColliderKernels& kernels_;
    std::vector<ParticleRange> bodies_;
    BodySweep sweep_;
    std::vector<Pair> bodies_near_;
    std::vector<Box> box_;              // per particle
    std::vector<Pair> pair_;            // of particles, of all pairs of bodies
    std::vector<std::uint32_t> place_;  // of kept_pair_, per pair of particles
    std::vector<ParticleRange> range_;  // of pair_, per pair of bodies
    std::size_t dropped_ = 0;
    // Of the last search.
    bool kept_ = false;  // it had a margin, and room for all pairs
    std::vector<Box> wide_;
    Boxes wide_rows_;
    std::vector<Bounds> wide_body_;
    std::vector<Pair> kept_bodies_;
    std::vector<ParticleRange> kept_range_;  // of kept_pair_, per pair of bodies
    std::vector<Pair> kept_pair_;
    std::vector<double> apart_until_;  // m, per kept pair: travel of both until which they are apart; 0: not known
    std::size_t kept_pairs_ = 0;
    Scratch scratch_;
};

}  // namespace haptic::sim
