// Broad phase of the particle collisions: finds overlapping swept boxes of different bodies.
//
// Sort and sweep: boxes are sorted along the longest side of their common region, by counting those that begin in each
// slice. Each is compared with the boxes after it, up to the slice in which it ends, 8 or 16 at a time. For this the
// six coordinates of a box and its body are small integers on a lattice. Rounding preserves order, so no pair is
// missed; each hit is checked again with the exact boxes.
// @source D. Baraff, "Dynamic Simulation of Non-Penetrating Rigid Bodies", 1992, sort and sweep
//
// Uniform grid, if sweeping would compare too many boxes, as for very many boxes side by side. Cells are as large as
// the largest box. Each box is in the cell of its centre, so overlapping boxes are in the same or neighbouring cells.
// Cells are hashed into a table, which is sorted by counting. Only one half of the neighbours is visited, so that each
// pair is found once.
//
// @source M. Teschner et al., "Optimized Spatial Hashing for Collision Detection of Deformable Objects", 2003, with a
// sorted table instead of lists
//
// Both sorts are stable: the pairs and their order depend on the boxes only.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "haptic/types.hpp"
#include "simd/aabb.hpp"
#include "simd/collider_rows.hpp"

namespace haptic::sim {

/// Box of a particle over its whole path within a step.
struct SweptBox {
    Aabb box{};
    std::uint32_t particle = 0;
    std::uint32_t body = 0;
};

/// Two overlapping boxes.
struct BoxPair {
    std::uint32_t first = 0;  // index of a box
    std::uint32_t second = 0;
};

/// Broad phase with preallocated memory for `max_boxes`.
class SweptPairs {
  public:
    SweptPairs(std::size_t max_boxes, const ColliderKernels& kernels);

    /// Writes the overlapping pairs of different bodies to `pairs` and returns their number. Pairs beyond its capacity
    /// are counted only. All boxes must be finite, at most max_boxes. No allocation.
    std::size_t find(std::span<const SweptBox> boxes, std::span<BoxPair> pairs) noexcept;

    /// Same, always with the grid; the order of the pairs differs.
    std::size_t find_in_grid(std::span<const SweptBox> boxes, std::span<BoxPair> pairs) noexcept;

  private:
    static constexpr std::size_t kSlices = 128;
    /// A box on the lattice: minima and maxima of x, y and z, and the body.
    static constexpr std::size_t kRows = 7;
    static constexpr std::size_t kLow = 0;
    static constexpr std::size_t kHigh = 3;
    static constexpr std::size_t kBody = 6;
    using LatticeBox = std::array<std::int16_t, kRows>;
    struct Entry {
        std::uint64_t cell = 0;
        std::uint32_t box = 0;
    };
    class PairWriter;

    std::size_t quantize(std::span<const SweptBox> boxes) noexcept;
    void sort_into_slices(std::size_t axis, std::size_t boxes) noexcept;
    [[nodiscard]] std::size_t sweep_end(std::size_t rank, std::size_t axis) const noexcept;
    void sort_into_table(std::span<const SweptBox> boxes) noexcept;
    [[nodiscard]] std::size_t table_slot(std::uint64_t cell) const noexcept;

    const ColliderKernels& kernels_;

    // Sort and sweep.
    std::vector<LatticeBox> quantized_;                 // per box
    std::array<std::uint32_t, kSlices + 1> slice_{};    // start of each slice in the sorted order
    std::array<std::vector<std::int16_t>, kRows> row_;  // in sorted order, padded by a whole vector
    std::vector<std::uint32_t> box_;                    // in sorted order
    std::vector<std::uint32_t> overlapping_;            // hits of one box

    // Grid.
    unsigned slot_bits_ = 1;
    std::vector<std::uint64_t> cell_;   // per box
    std::vector<std::uint32_t> begin_;  // start of each slot in entry_, and the end
    std::vector<Entry> entry_;          // sorted by slot
};

}  // namespace haptic::sim
