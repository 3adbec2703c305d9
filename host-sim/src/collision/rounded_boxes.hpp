// Boxes rounded to float, outward, and lists of them in rows for find_overlaps().
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "haptic/types.hpp"
#include "simd/collider_rows.hpp"

namespace haptic::sim {

/// A box that holds nothing: including another one makes it that one.
[[nodiscard]] constexpr RoundedBox empty_box() noexcept {
    constexpr float far = std::numeric_limits<float>::max();
    return {{far, far, far, -far, -far, -far}};
}

inline void include(RoundedBox& box, const RoundedBox& other) noexcept {
    for (std::size_t k = 0; k < 3; ++k) {
        box.number[k] = std::min(box.number[k], other.number[k]);
        box.number[k + 3] = std::max(box.number[k + 3], other.number[k + 3]);
    }
}

// More than rounding takes from a float.
inline constexpr float kRoundingOfFloats = std::numeric_limits<float>::epsilon();

[[nodiscard]] inline float below(float x) noexcept {
    return x - std::abs(x) * kRoundingOfFloats;
}
[[nodiscard]] inline float above(float x) noexcept {
    return x + std::abs(x) * kRoundingOfFloats;
}

/// The box of both ends of a way, and up to `margin` away from it along each axis, m.
[[nodiscard]] inline RoundedBox box_around(const Vec3& start, const Vec3& end, const Vec3& margin) noexcept {
    RoundedBox box;  // NOLINT(cppcoreguidelines-pro-type-member-init): written here
    for (int k = 0; k < 3; ++k) {
        box.number[k] = below(static_cast<float>(std::min(start[k], end[k]) - margin[k]));
        box.number[k + 3] = above(static_cast<float>(std::max(start[k], end[k]) + margin[k]));
    }
    return box;
}

/// What a box covers in a frame in which its own moves along some way: `sweep` holds the way's bounds.
[[nodiscard]] inline RoundedBox swept(const RoundedBox& box, const RoundedBox& sweep) noexcept {
    RoundedBox whole;  // NOLINT(cppcoreguidelines-pro-type-member-init): written here
    for (std::size_t k = 0; k < 3; ++k) {
        whole.number[k] = below(box.number[k] + sweep.number[k]);
        whole.number[k + 3] = above(box.number[k + 3] + sweep.number[k + 3]);
    }
    return whole;
}

/// Bounds of the way from 0 to `way`.
[[nodiscard]] inline RoundedBox sweep_of(const Vec3& way) noexcept {
    RoundedBox sweep{};
    for (int k = 0; k < 3; ++k) {
        sweep.number[k] = below(static_cast<float>(std::min(0.0, way[k])));
        sweep.number[k + 3] = above(static_cast<float>(std::max(0.0, way[k])));
    }
    return sweep;
}

/// Boxes in rows: low x, y, z, then high; with room for a whole vector behind.
class RoundedBoxes {
  public:
    void resize(std::size_t boxes) {
        size_ = boxes;
        length_ = boxes + kPadding;
        // What is not a number overlaps nothing.
        number_.assign(kRows * length_, std::numeric_limits<float>::quiet_NaN());
    }
    [[nodiscard]] std::size_t size() const noexcept { return size_; }
    [[nodiscard]] BoxRows rows() const noexcept { return {number_.data(), length_}; }
    [[nodiscard]] RoundedBox operator[](std::size_t at) const noexcept {
        RoundedBox box;  // NOLINT(cppcoreguidelines-pro-type-member-init): written here
        for (std::size_t k = 0; k < kRows; ++k) {
            box.number[k] = number_[k * length_ + at];
        }
        return box;
    }
    void set(std::size_t at, const RoundedBox& box) noexcept {
        for (std::size_t k = 0; k < kRows; ++k) {
            number_[k * length_ + at] = box.number[k];
        }
    }
    /// Numbers that find_overlaps() may write beyond those that it finds.
    static constexpr std::size_t kPadding = 16;

  private:
    static constexpr std::size_t kRows = 6;
    std::size_t size_ = 0;
    std::size_t length_ = 0;
    std::vector<float> number_;
};

}  // namespace haptic::sim
