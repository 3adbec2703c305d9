// Which boxes of different bodies overlap: the broad phase of collisions between particles.
//
// A uniform grid whose cells are as large as the largest box. Each box is in the cell of its middle, so boxes that
// overlap are in the same cell or in neighbours. Cells are hashed into a table and sorted into it by counting, which
// keeps the order of the boxes: the pairs, and their order, depend on the boxes only. Neighbours are looked up in one
// half of the directions, so that each pair is found once.
// @source M. Teschner et al., "Optimized Spatial Hashing for Collision Detection of Deformable Objects", 2003, with a
// sorted table in place of lists
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "haptic/types.hpp"

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
    explicit SweptPairs(std::size_t most_boxes);

    /// Writes the pairs of boxes of different bodies that overlap to `pairs`, and tells how many there are; those that
    /// find no room in it are only counted. All boxes are finite and not more than there may be. Allocates nothing.
    std::size_t find(std::span<const SweptBox> boxes, std::span<BoxPair> pairs) noexcept;

  private:
    struct Entry {
        std::uint64_t cell = 0;
        std::uint32_t box = 0;
    };
    void sort_into_table(std::span<const SweptBox> boxes) noexcept;
    [[nodiscard]] std::size_t slot_of(std::uint64_t cell) const noexcept;

    unsigned slot_bits_ = 1;
    std::vector<std::uint64_t> cell_;   // per box
    std::vector<std::uint32_t> begin_;  // per slot of the table, and one more
    std::vector<Entry> entry_;          // sorted by slot
};

}  // namespace haptic::sim
