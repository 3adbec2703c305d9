// Which boxes of different bodies overlap: the broad phase of collisions between particles.
//
// Boxes are sorted along the longest side of the region that holds them, by counting those that begin in each slice of
// it. Each is compared with those after it, up to the slice where it ends, 8 or 16 at a time: on a lattice of the
// region the six numbers of a box, and that of its body, are small integers. Rounding keeps order, so that nothing is
// missed; what it finds is looked at again with the boxes as they are.
// @source D. Baraff, "Dynamic Simulation of Non-Penetrating Rigid Bodies", 1992, sort and sweep
//
// Where that would be too much, as for very many boxes side by side, there is a uniform grid whose cells are as large
// as the largest box. Each box is in the cell of its middle, so boxes that overlap are in the same cell or in
// neighbours. Cells are hashed into a table and sorted into it by counting. Neighbours are looked up in one half of the
// directions, so that each pair is found once.
// @source M. Teschner et al., "Optimized Spatial Hashing for Collision Detection of Deformable Objects", 2003, with a
// sorted table in place of lists
//
// Both keep the order of boxes that are sorted alike: the pairs, and their order, depend on the boxes only.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "simd/collider_rows.hpp"
#include <haptic/types.hpp>

namespace haptic::sim {

/// Holds a particle on its whole way within a step.
struct SweptBox {
    Vec3 low{0.0};
    Vec3 high{0.0};
    std::uint32_t particle = 0;
    std::uint32_t body = 0;
};

[[nodiscard]] inline bool overlap(const SweptBox& a, const SweptBox& b) noexcept {
    return a.low.x <= b.high.x && b.low.x <= a.high.x && a.low.y <= b.high.y && b.low.y <= a.high.y &&
           a.low.z <= b.high.z && b.low.z <= a.high.z;
}

struct BoxPair {
    std::uint32_t first = 0;  // index of a box
    std::uint32_t second = 0;
};

class SweptPairs {
  public:
    SweptPairs(std::size_t most_boxes, const ColliderKernels& kernels);

    /// Writes the pairs of boxes of different bodies that overlap to `pairs`, and tells how many there are; those that
    /// find no room in it are only counted. All boxes are finite and not more than there may be. Allocates nothing.
    std::size_t find(std::span<const SweptBox> boxes, std::span<BoxPair> pairs) noexcept;

    /// The same by the grid in any case; only the order is another.
    std::size_t find_in_grid(std::span<const SweptBox> boxes, std::span<BoxPair> pairs) noexcept;

  private:
    static constexpr std::size_t kSlices = 128;
    /// A box on the lattice: lows and highs of x, y and z, and the body.
    static constexpr std::size_t kRows = 7;
    static constexpr std::size_t kLow = 0;
    static constexpr std::size_t kHigh = 3;
    static constexpr std::size_t kBody = 6;
    using Rounded = std::array<std::int16_t, kRows>;
    struct Entry {
        std::uint64_t cell = 0;
        std::uint32_t box = 0;
    };
    class Sink;

    std::size_t round(std::span<const SweptBox> boxes) noexcept;
    void sort_into_slices(std::size_t axis, std::size_t boxes) noexcept;
    [[nodiscard]] std::size_t end_of(std::size_t place, std::size_t axis) const noexcept;
    void sort_into_table(std::span<const SweptBox> boxes) noexcept;
    [[nodiscard]] std::size_t slot_of(std::uint64_t cell) const noexcept;

    const ColliderKernels& kernels_;

    // Of the sweep.
    std::vector<Rounded> rounded_;                      // per box
    std::array<std::uint32_t, kSlices + 1> slice_{};    // where each begins, in the order of slices
    std::array<std::vector<std::int16_t>, kRows> row_;  // in the order of slices, and a whole vector behind them
    std::vector<std::uint32_t> box_;                    // in the order of slices
    std::vector<std::uint32_t> overlapping_;            // one of them

    // Of the grid.
    unsigned slot_bits_ = 1;
    std::vector<std::uint64_t> cell_;   // per box
    std::vector<std::uint32_t> begin_;  // per slot of the table, and one more
    std::vector<Entry> entry_;          // sorted by slot
};

}  // namespace haptic::sim
