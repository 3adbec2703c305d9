#include "collision/swept_pairs.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <glm/common.hpp>

namespace haptic::sim {
namespace {

// Behind the rows: a whole vector.
constexpr std::size_t kBehind = 32 / sizeof(std::int16_t);
// Along each side of the lattice.
constexpr double kLastCell = 32767.0;
constexpr unsigned kSliceBits = 8;  // 256 cells
// Of numbers of bodies.
constexpr std::uint32_t kMostBodies = 32768;
// Boxes compared with each, on average, from which the grid is faster (Zen 4).
constexpr std::size_t kMostCompared = 1000;

std::size_t slice_of(std::int16_t number) noexcept {
    return static_cast<std::size_t>(number) >> kSliceBits;
}

// A cell's number holds three coordinates of 21 bits. The outermost layers stay empty, so that neighbours need no test.
constexpr unsigned kCoordinateBits = 21;
constexpr double kMostCells = (1u << kCoordinateBits) - 3;

constexpr std::uint64_t cell_step(int x, int y, int z) {
    return static_cast<std::uint64_t>(x) + (static_cast<std::uint64_t>(y) << kCoordinateBits) +
           (static_cast<std::uint64_t>(z) << (2 * kCoordinateBits));
}

/// One of each two opposite neighbours, as what is added to a cell's number.
constexpr std::array<std::uint64_t, 13> kNeighbours{
    cell_step(1, 0, 0),  cell_step(-1, 1, 0), cell_step(0, 1, 0),  cell_step(1, 1, 0), cell_step(-1, -1, 1),
    cell_step(0, -1, 1), cell_step(1, -1, 1), cell_step(-1, 0, 1), cell_step(0, 0, 1), cell_step(1, 0, 1),
    cell_step(-1, 1, 1), cell_step(0, 1, 1),  cell_step(1, 1, 1)};

/// What lies further out than there are numbers for shares the last cell, which changes no pair.
std::uint64_t coordinate(double from_corner, double inverse_size) noexcept {
    return 1 + static_cast<std::uint64_t>(std::min(from_corner * inverse_size, kMostCells));
}

/// Of a table with two to four slots for each box.
unsigned slot_bits_for(std::size_t boxes) noexcept {
    return static_cast<unsigned>(std::bit_width(2 * boxes));
}

}  // namespace

/// Takes those that overlap.
class SweptPairs::Sink {
  public:
    Sink(std::span<const SweptBox> boxes, std::span<BoxPair> pairs) noexcept : boxes_(boxes), pairs_(pairs) {}
    void offer(std::uint32_t first, std::uint32_t second) noexcept {
        const SweptBox& a = boxes_[first];
        const SweptBox& b = boxes_[second];
        if (a.body != b.body && overlap(a, b)) {
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

SweptPairs::SweptPairs(std::size_t most_boxes, const ColliderKernels& kernels)
    : kernels_(kernels),
      rounded_(most_boxes),
      box_(most_boxes),
      overlapping_(most_boxes),
      cell_(most_boxes),
      begin_((std::size_t{1} << slot_bits_for(most_boxes)) + 1),
      entry_(most_boxes) {
    static_assert(kSlices << kSliceBits == static_cast<std::size_t>(kLastCell) + 1);
    for (std::vector<std::int16_t>& row : row_) {
        row.resize(most_boxes + kBehind);
    }
}

/// Puts all boxes on the lattice of their region, and tells which of its sides is the longest.
std::size_t SweptPairs::round(std::span<const SweptBox> boxes) noexcept {
    Vec3 low = boxes[0].low;
    Vec3 high = boxes[0].high;
    for (const SweptBox& box : boxes) {
        low = glm::min(low, box.low);
        high = glm::max(high, box.high);
    }
    const Vec3 side = high - low;
    Vec3 per_m(0.0);
    for (int k = 0; k < 3; ++k) {
        per_m[k] = side[k] > 0.0 ? kLastCell / side[k] : 0.0;
    }
    // Each operation keeps the order of its arguments, rounding included.
    const auto number = [](double x) { return static_cast<std::int16_t>(std::min(x, kLastCell)); };
    for (std::size_t i = 0; i < boxes.size(); ++i) {
        const Vec3 from = (boxes[i].low - low) * per_m;
        const Vec3 to = (boxes[i].high - low) * per_m;
        rounded_[i] = {number(from.x),
                       number(from.y),
                       number(from.z),
                       number(to.x),
                       number(to.y),
                       number(to.z),
                       static_cast<std::int16_t>(boxes[i].body)};
    }
    return side.x >= side.y && side.x >= side.z ? 0 : side.y >= side.z ? 1 : 2;
}

void SweptPairs::sort_into_slices(std::size_t axis, std::size_t boxes) noexcept {
    slice_.fill(0);
    for (std::size_t i = 0; i < boxes; ++i) {
        ++slice_[slice_of(rounded_[i][axis])];
    }
    std::uint32_t end = 0;
    for (std::uint32_t& slice : slice_) {
        slice = end += slice;
    }
    for (std::size_t i = boxes; i-- > 0;) {
        const std::size_t place = --slice_[slice_of(rounded_[i][axis])];
        for (std::size_t k = 0; k < kRows; ++k) {
            row_[k][place] = rounded_[i][k];
        }
        box_[place] = static_cast<std::uint32_t>(i);
    }
}

/// Behind all that begin where the one in this place may still meet them.
std::size_t SweptPairs::end_of(std::size_t place, std::size_t axis) const noexcept {
    return slice_[slice_of(row_[kHigh + axis][place]) + 1];
}

std::size_t SweptPairs::slot_of(std::uint64_t cell) const noexcept {
    return (cell * 0x9E3779B97F4A7C15u) >> (64 - slot_bits_);  // multiplicative hashing, Knuth 1973
}

void SweptPairs::sort_into_table(std::span<const SweptBox> boxes) noexcept {
    Vec3 corner = boxes[0].low;
    Vec3 largest(0.0);
    for (const SweptBox& box : boxes) {
        corner = glm::min(corner, box.low);
        largest = glm::max(largest, box.high - box.low);
    }
    const double size = std::max({largest.x, largest.y, largest.z});
    const double inverse_size = size > 0.0 ? 1.0 / size : 0.0;
    slot_bits_ = slot_bits_for(boxes.size());
    const std::size_t slots = std::size_t{1} << slot_bits_;
    std::fill_n(begin_.begin(), slots, 0u);
    for (std::size_t i = 0; i < boxes.size(); ++i) {
        const Vec3 middle = 0.5 * (boxes[i].low + boxes[i].high) - corner;
        cell_[i] = coordinate(middle.x, inverse_size) + (coordinate(middle.y, inverse_size) << kCoordinateBits) +
                   (coordinate(middle.z, inverse_size) << (2 * kCoordinateBits));
        ++begin_[slot_of(cell_[i])];
    }
    std::uint32_t end = 0;
    for (std::size_t s = 0; s < slots; ++s) {
        begin_[s] = end += begin_[s];
    }
    begin_[slots] = end;
    for (std::size_t i = boxes.size(); i-- > 0;) {
        entry_[--begin_[slot_of(cell_[i])]] = {cell_[i], static_cast<std::uint32_t>(i)};
    }
}

std::size_t SweptPairs::find(std::span<const SweptBox> boxes, std::span<BoxPair> pairs) noexcept {
    if (boxes.size() < 2) {
        return 0;
    }
    const auto has_large_number = [](const SweptBox& box) { return box.body >= kMostBodies; };
    if (std::any_of(boxes.begin(), boxes.end(), has_large_number)) {
        return find_in_grid(boxes, pairs);
    }
    const std::size_t axis = round(boxes);
    sort_into_slices(axis, boxes.size());
    std::size_t to_compare = 0;
    for (std::size_t place = 0; place < boxes.size(); ++place) {
        to_compare += end_of(place, axis) - place;
    }
    if (to_compare > kMostCompared * boxes.size()) {
        return find_in_grid(boxes, pairs);
    }
    LatticeRows rows{};
    for (std::size_t k = 0; k < kRows; ++k) {
        rows.row[k] = row_[k].data();
    }
    Sink sink(boxes, pairs);
    for (std::size_t place = 0; place < boxes.size(); ++place) {
        const std::size_t found = kernels_.compare_boxes(rows, place, end_of(place, axis), overlapping_.data());
        for (std::size_t k = 0; k < found; ++k) {
            sink.offer(box_[place], box_[overlapping_[k]]);
        }
    }
    return sink.found();
}

std::size_t SweptPairs::find_in_grid(std::span<const SweptBox> boxes, std::span<BoxPair> pairs) noexcept {
    if (boxes.size() < 2) {
        return 0;
    }
    sort_into_table(boxes);
    Sink sink(boxes, pairs);
    for (std::size_t e = 0; e < boxes.size(); ++e) {
        const Entry& entry = entry_[e];
        const std::size_t own_end = begin_[slot_of(entry.cell) + 1];
        for (std::size_t other = e + 1; other < own_end; ++other) {
            if (entry_[other].cell == entry.cell) {
                sink.offer(entry.box, entry_[other].box);
            }
        }
        for (const std::uint64_t step : kNeighbours) {
            const std::uint64_t cell = entry.cell + step;
            const std::size_t slot = slot_of(cell);
            for (std::size_t other = begin_[slot]; other < begin_[slot + 1]; ++other) {
                if (entry_[other].cell == cell) {
                    sink.offer(entry.box, entry_[other].box);
                }
            }
        }
    }
    return sink.found();
}

}  // namespace haptic::sim
