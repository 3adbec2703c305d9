#include "swept_pairs.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <glm/common.hpp>

namespace haptic::sim {
namespace {

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

SweptPairs::SweptPairs(std::size_t most_boxes)
    : cell_(most_boxes), begin_((std::size_t{1} << slot_bits_for(most_boxes)) + 1), entry_(most_boxes) {}

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
    sort_into_table(boxes);
    std::size_t found = 0;
    const auto try_pair = [&](std::uint32_t first, std::uint32_t second) {
        const SweptBox& a = boxes[first];
        const SweptBox& b = boxes[second];
        if (a.body != b.body && overlap(a, b)) {
            if (found < pairs.size()) {
                pairs[found] = {first, second};
            }
            ++found;
        }
    };
    for (std::size_t e = 0; e < boxes.size(); ++e) {
        const Entry& entry = entry_[e];
        const std::size_t own_end = begin_[slot_of(entry.cell) + 1];
        for (std::size_t other = e + 1; other < own_end; ++other) {
            if (entry_[other].cell == entry.cell) {
                try_pair(entry.box, entry_[other].box);
            }
        }
        for (const std::uint64_t step : kNeighbours) {
            const std::uint64_t cell = entry.cell + step;
            const std::size_t slot = slot_of(cell);
            for (std::size_t other = begin_[slot]; other < begin_[slot + 1]; ++other) {
                if (entry_[other].cell == cell) {
                    try_pair(entry.box, entry_[other].box);
                }
            }
        }
    }
    return found;
}

}  // namespace haptic::sim
