// Broad phase: pairs of particles of different bodies whose boxes overlap.
//
// First bodies, by a sweep along the axis on which their boxes are spread most (D. Baraff, 1992: sort and sweep). Then,
// for each two bodies, the particles of each that reach into the box of the other, one against the other; where these
// are many, in order along an axis, so that each meets only those next to it. Boxes are compared as numbers of 32 bits,
// rounded, which loses no pair; what is left is compared exactly.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "dynamics/constraint_batches.hpp"
#include "haptic/sim/particles.hpp"
#include "simd/collider_rows.hpp"

namespace haptic::sim {

class NearPairs {
  public:
    /// Two bodies, or a particle of each.
    struct Pair {
        std::uint32_t first;
        std::uint32_t second;
    };

    /// `bodies` hold all particles. Allocates for `capacity` pairs of particles.
    NearPairs(std::vector<ParticleRange> bodies, std::size_t capacity, const ColliderKernels& kernels);

    /// Finds the pairs of bodies whose boxes overlap, one box per body.
    std::span<const Pair> find_bodies(std::span<const Bounds> box);
    /// Finds the pairs of particles of these bodies, from the rows kLow and kHigh. Those without a size or with numbers
    /// beyond kMaxCoordinate have none.
    void find_particles(const ColliderRows& rows);
    /// Those of the k-th pair of bodies, always in the same order: the first is of the first body.
    [[nodiscard]] std::span<const Pair> particles(std::size_t k) const noexcept {
        return std::span(pair_).subspan(k * share_, found_[k]);
    }
    /// Number of pairs of particles for which there was no room.
    [[nodiscard]] std::size_t dropped() const noexcept;

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
    struct Scratch {
        explicit Scratch(std::size_t largest_body);
        std::vector<std::uint32_t> outer;  // particles of both bodies, fewer
        std::vector<std::uint32_t> inner;  // and more
        std::vector<std::uint32_t> hits;   // places in `inner`
        std::vector<std::pair<float, std::uint32_t>> order;
        Boxes boxes;  // of `inner`
    };

    void round_boxes(const ColliderRows& rows);
    void find_particles_of(std::size_t k, const ColliderRows& rows);
    [[nodiscard]] RoundedBox around(const std::vector<std::uint32_t>& particles, std::size_t count) const;
    [[nodiscard]] std::size_t reaching_into(const RoundedBox& box, const ParticleRange& body,
                                            std::vector<std::uint32_t>& particles) const;

    const ColliderKernels& kernels_;
    std::vector<ParticleRange> bodies_;
    std::span<const Bounds> body_box_;
    std::vector<std::uint32_t> order_;  // of bodies along an axis, kept from one call to the next
    std::vector<Pair> bodies_near_;
    Boxes box_;               // of all particles
    std::vector<Pair> pair_;  // equal shares for all pairs of bodies
    std::size_t share_ = 0;
    std::vector<std::size_t> found_;    // per pair of bodies
    std::vector<std::size_t> dropped_;  // per pair of bodies
    Scratch scratch_;
};

}  // namespace haptic::sim
