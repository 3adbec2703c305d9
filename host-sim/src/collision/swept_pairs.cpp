#include "collision/swept_pairs.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <glm/common.hpp>

namespace haptic::sim {
namespace {

// Padding of the rows: a whole vector.
constexpr std::size_t kPadding = 32 / sizeof(std::int16_t);
// Lattice coordinates are 0 .. 32767 along each side.
constexpr double kLastCell = 32767.0;
constexpr unsigned kSliceBits = 8;  // 256 cells a slice
// Body indices must fit into 15 bits.
constexpr std::uint32_t kMaxBodies = 32768;
// Comparisons per box, on average, above which the grid is faster (Zen 4).
constexpr std::size_t kMaxComparisons = 1000;

std::size_t slice_index(std::int16_t number) noexcept {
    return static_cast<std::size_t>(number) >> kSliceBits;
}

// A cell index packs three coordinates of 21 bits. The outermost layers stay empty, so that neighbours need no range
// test.
constexpr unsigned kCoordinateBits = 21;
constexpr double kMaxCells = (1u << kCoordinateBits) - 3;

constexpr std::uint64_t cell_step(int x, int y, int z) {
    return static_cast<std::uint64_t>(x) + (static_cast<std::uint64_t>(y) << kCoordinateBits) +
           (static_cast<std::uint64_t>(z) << (2 * kCoordinateBits));
}

/// One of each pair of opposite neighbours, as an offset of the cell index.
constexpr std::array<std::uint64_t, 13> kNeighbours{
    cell_step(1, 0, 0),  cell_step(-1, 1, 0), cell_step(0, 1, 0),  cell_step(1, 1, 0), cell_step(-1, -1, 1),
    cell_step(0, -1, 1), cell_step(1, -1, 1), cell_step(-1, 0, 1), cell_step(0, 0, 1), cell_step(1, 0, 1),
    cell_step(-1, 1, 1), cell_step(0, 1, 1),  cell_step(1, 1, 1)};

/// Cell coordinate. Boxes beyond the last cell share it, which loses no pair.
std::uint64_t coordinate(double from_corner, double inverse_size) noexcept {
    return 1 + static_cast<std::uint64_t>(std::min(from_corner * inverse_size, kMaxCells));
}

/// Size of a hash table with two to four slots per box, in bits.
unsigned slot_bits_for(std::size_t boxes) noexcept {
    return static_cast<unsigned>(std::bit_width(2 * boxes));
}

}  // namespace

/// Writes the candidate pairs whose exact boxes overlap.
class SweptPairs::PairWriter {
  public:
    PairWriter(std::span<const SweptBox> boxes, std::span<BoxPair> pairs) noexcept : boxes_(boxes), pairs_(pairs) {}
    void add_if_overlapping(std::uint32_t first, std::uint32_t second) noexcept {
        const SweptBox& a = boxes_[first];
        const SweptBox& b = boxes_[second];
        // Exact test: the lattice or the hash cell may report pairs that are only close.
        if (a.body != b.body && overlaps(a.box, b.box)) {
            if (found_ < pairs_.size()) {
                pairs_[found_] = {first, second};
            }
            ++found_;
        }
    }
    [[nodiscard]] std::size_t found() const noexcept { return found_; }

  private:
    std::span<const SweptBox> boxes_;
    std::span<BoxPair> pairs_;
    std::size_t found_ = 0;
};

SweptPairs::SweptPairs(std::size_t max_boxes, const ColliderKernels& kernels)
    : kernels_(kernels),
      quantized_(max_boxes),
      box_(max_boxes),
      overlapping_(max_boxes),
      cell_(max_boxes),
      begin_((std::size_t{1} << slot_bits_for(max_boxes)) + 1),
      entry_(max_boxes) {
    static_assert(kSlices << kSliceBits == static_cast<std::size_t>(kLastCell) + 1);
    for (std::vector<std::int16_t>& row : row_) {
        row.resize(max_boxes + kPadding);
    }
}

/// Puts all boxes on the lattice of their common region and returns the axis of its longest side.
std::size_t SweptPairs::quantize(std::span<const SweptBox> boxes) noexcept {
    // Common region of all boxes, mapped to the whole range of 16-bit coordinates.
    Aabb region = boxes[0].box;
    for (const SweptBox& swept : boxes) {
        region.extend(swept.box);
    }
    const Vec3 side = region.size();
    // Scale of each axis; a flat region maps to cell 0.
    Vec3 cells_per_m(0.0);
    for (int k = 0; k < 3; ++k) {
        cells_per_m[k] = side[k] > 0.0 ? kLastCell / side[k] : 0.0;
    }
    // Subtraction, multiplication and truncation are monotonic, also with rounding, so the order is preserved.
    const auto lattice = [](double x) { return static_cast<std::int16_t>(std::min(x, kLastCell)); };
    for (std::size_t i = 0; i < boxes.size(); ++i) {
        const Vec3 from = (boxes[i].box.min - region.min) * cells_per_m;
        const Vec3 to = (boxes[i].box.max - region.min) * cells_per_m;
        quantized_[i] = {lattice(from.x),
                         lattice(from.y),
                         lattice(from.z),
                         lattice(to.x),
                         lattice(to.y),
                         lattice(to.z),
                         static_cast<std::int16_t>(boxes[i].body)};
    }
    // Sweep along the longest side, where the boxes are spread most.
    return side.x >= side.y && side.x >= side.z ? 0 : side.y >= side.z ? 1 : 2;
}

/// Counting sort of the boxes by the slice in which they begin.
void SweptPairs::sort_into_slices(std::size_t axis, std::size_t boxes) noexcept {
    // Histogram, then prefix sums: slice_[s] is the end of slice s.
    slice_.fill(0);
    for (std::size_t i = 0; i < boxes; ++i) {
        ++slice_[slice_index(quantized_[i][axis])];
    }
    std::uint32_t end = 0;
    for (std::uint32_t& slice : slice_) {
        slice = end += slice;
    }
    // Fill from the end, so that the sort is stable and slice_[s] becomes the start.
    for (std::size_t i = boxes; i-- > 0;) {
        const std::size_t rank = --slice_[slice_index(quantized_[i][axis])];
        for (std::size_t k = 0; k < kRows; ++k) {
            row_[k][rank] = quantized_[i][k];
        }
        box_[rank] = static_cast<std::uint32_t>(i);
    }
}

/// End of the boxes that begin in or before the slice in which this one ends.
std::size_t SweptPairs::sweep_end(std::size_t rank, std::size_t axis) const noexcept {
    return slice_[slice_index(row_[kHigh + axis][rank]) + 1];
}

std::size_t SweptPairs::table_slot(std::uint64_t cell) const noexcept {
    return (cell * 0x9E3779B97F4A7C15u) >> (64 - slot_bits_);  // multiplicative hashing, Knuth 1973
}

/// Hashes each box by the cell of its centre and sorts the table by slot.
void SweptPairs::sort_into_table(std::span<const SweptBox> boxes) noexcept {
    // Cell size: the largest box.
    Vec3 corner = boxes[0].box.min;
    Vec3 largest(0.0);
    for (const SweptBox& swept : boxes) {
        corner = glm::min(corner, swept.box.min);
        largest = glm::max(largest, swept.box.size());
    }
    const double size = std::max({largest.x, largest.y, largest.z});
    const double inverse_size = size > 0.0 ? 1.0 / size : 0.0;
    // Histogram of the slots.
    slot_bits_ = slot_bits_for(boxes.size());
    const std::size_t slots = std::size_t{1} << slot_bits_;
    std::fill_n(begin_.begin(), slots, 0u);
    for (std::size_t i = 0; i < boxes.size(); ++i) {
        const Vec3 middle = boxes[i].box.center() - corner;
        cell_[i] = coordinate(middle.x, inverse_size) + (coordinate(middle.y, inverse_size) << kCoordinateBits) +
                   (coordinate(middle.z, inverse_size) << (2 * kCoordinateBits));
        ++begin_[table_slot(cell_[i])];
    }
    // Prefix sums, then fill from the end: begin_[s] becomes the start of slot s.
    std::uint32_t end = 0;
    for (std::size_t s = 0; s < slots; ++s) {
        begin_[s] = end += begin_[s];
    }
    begin_[slots] = end;
    for (std::size_t i = boxes.size(); i-- > 0;) {
        entry_[--begin_[table_slot(cell_[i])]] = {cell_[i], static_cast<std::uint32_t>(i)};
    }
}

std::size_t SweptPairs::find(std::span<const SweptBox> boxes, std::span<BoxPair> pairs) noexcept {
    if (boxes.size() < 2) {
        return 0;
    }
    // Body indices that do not fit into a lattice row: use the grid.
    const auto exceeds_int16 = [](const SweptBox& box) { return box.body >= kMaxBodies; };
    if (std::any_of(boxes.begin(), boxes.end(), exceeds_int16)) {
        return find_in_grid(boxes, pairs);
    }
    const std::size_t axis = quantize(boxes);
    sort_into_slices(axis, boxes.size());
    // Number of comparisons of a sweep; the grid is faster beyond the limit.
    std::size_t comparisons = 0;
    for (std::size_t rank = 0; rank < boxes.size(); ++rank) {
        comparisons += sweep_end(rank, axis) - rank;
    }
    if (comparisons > kMaxComparisons * boxes.size()) {
        return find_in_grid(boxes, pairs);
    }
    LatticeRows rows{};
    for (std::size_t k = 0; k < kRows; ++k) {
        rows.row[k] = row_[k].data();
    }
    // Sweep: compare each box with those that begin before it ends.
    PairWriter writer(boxes, pairs);
    for (std::size_t rank = 0; rank < boxes.size(); ++rank) {
        const std::size_t found = kernels_.find_overlaps(rows, rank, sweep_end(rank, axis), overlapping_.data());
        for (std::size_t k = 0; k < found; ++k) {
            writer.add_if_overlapping(box_[rank], box_[overlapping_[k]]);
        }
    }
    return writer.found();
}

std::size_t SweptPairs::find_in_grid(std::span<const SweptBox> boxes, std::span<BoxPair> pairs) noexcept {
    if (boxes.size() < 2) {
        return 0;
    }
    // Cells are as large as the largest box, so partners are in the same or an adjacent cell.
    sort_into_table(boxes);
    PairWriter writer(boxes, pairs);
    for (std::size_t e = 0; e < boxes.size(); ++e) {
        const Entry& entry = entry_[e];
        // Same cell: entries of other cells may share the slot.
        const std::size_t own_end = begin_[table_slot(entry.cell) + 1];
        for (std::size_t other = e + 1; other < own_end; ++other) {
            if (entry_[other].cell == entry.cell) {
                writer.add_if_overlapping(entry.box, entry_[other].box);
            }
        }
        // One half of the neighbouring cells.
        for (const std::uint64_t step : kNeighbours) {
            const std::uint64_t cell = entry.cell + step;
            const std::size_t slot = table_slot(cell);
            for (std::size_t other = begin_[slot]; other < begin_[slot + 1]; ++other) {
                if (entry_[other].cell == cell) {
                    writer.add_if_overlapping(entry.box, entry_[other].box);
                }
            }
        }
    }
    return writer.found();
}

}  // namespace haptic::sim
