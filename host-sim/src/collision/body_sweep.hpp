// Pairs of bodies whose boxes overlap, by a sweep along the axis on which the boxes are spread most (D. Baraff, 1992:
// sort and sweep).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "simd/aabb.hpp"
#include "simd/collider_rows.hpp"

namespace haptic::sim {

struct BodyPair {
    std::uint32_t first;
    std::uint32_t second;
};

[[nodiscard]] inline Bounds bounds_of(const Aabb& box) noexcept {
    return {{box.min.x, box.min.y, box.min.z}, {box.max.x, box.max.y, box.max.z}};
}

/// Whether two boxes have a point in common, their borders included.
[[nodiscard]] inline bool overlap(const Bounds& a, const Bounds& b) noexcept {
    bool both = true;
    for (int k = 0; k < 3; ++k) {
        both &= (a.low[k] <= b.high[k]) & (b.low[k] <= a.high[k]);
    }
    return both;
}

/// The axis along which the minima of boxes, low(k, axis), are spread most.
template <class Low>
[[nodiscard]] std::size_t widest_axis(std::size_t count, const Low& low) noexcept {
    std::size_t widest = 0;
    double longest = 0.0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        double first = std::numeric_limits<double>::max();
        double last = std::numeric_limits<double>::lowest();
        for (std::size_t k = 0; k < count; ++k) {
            first = std::min(first, static_cast<double>(low(k, axis)));
            last = std::max(last, static_cast<double>(low(k, axis)));
        }
        if (last - first > longest) {
            longest = last - first;
            widest = axis;
        }
    }
    return widest;
}

class BodySweep {
  public:
    explicit BodySweep(std::size_t bodies);
    /// Writes the pairs, in order, the lower number first. One box per body.
    void find(std::span<const Bounds> box, std::vector<BodyPair>& near);

  private:
    std::vector<std::uint32_t> order_;  // of bodies along an axis, kept from one call to the next
};

}  // namespace haptic::sim
