// Boxes of the triangles of one leaf in single precision: the cull in front of every exact test.
//
// A box is two registers, whose fourth lane is unused. Conversion to single precision keeps the order of numbers, so
// boxes that overlap still overlap in single precision; only the limits of a query get a margin. The vertices of a leaf
// are converted once, though each belongs to several of its triangles.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "contact/scratch.hpp"
#include "contact/swept_tree.hpp"
#include "haptic/types.hpp"
#include "simd/aabb.hpp"

namespace haptic::sim {

/// Which positions of a triangle a query covers.
enum class QueryTime : std::uint8_t {
    WholeStep,  // any during the step
    EndOfStep,  // the positions at t = 1
};

/// Volume swept by a sphere along a straight line: its box and its bounding sphere.
struct SweptSphere {
    SweptSphere(const Vec3& from, const Vec3& to, double radius) noexcept;

    Aabb box;
    Vec3 center;                   // m, centre of the bounding sphere
    double bounding_radius = 0.0;  // m
};

/// A box in two registers.
struct PackedBox {
    /// Four floats, in one register on every target.
    using Lanes = float __attribute__((vector_size(16)));

    Lanes low;  // [x, y, z, 0]
    Lanes high;
};

/// A box to compare packed boxes with, with a margin for rounding.
class BoxLimits {
  public:
    explicit BoxLimits(const Aabb& box) noexcept;

    [[nodiscard]] bool overlap(const PackedBox& box) const noexcept {
        using Halves = std::int64_t __attribute__((vector_size(16)));
        const Halves meets = __builtin_bit_cast(Halves, (box.low <= high_) & (box.high >= low_));
        return (meets[0] & meets[1]) == -1;
    }

  private:
    PackedBox::Lanes low_;
    PackedBox::Lanes high_;
};

/// A sphere to compare packed boxes with: a box around it, then the sphere itself.
class SphereLimits {
  public:
    /// A swept sphere: its box and its bounding sphere.
    explicit SphereLimits(const SweptSphere& sphere) noexcept;
    /// A sphere whose centre is anywhere in a box.
    SphereLimits(const Aabb& centers, double radius) noexcept;

    [[nodiscard]] bool overlap(const PackedBox& box) const noexcept {
        if (!box_.overlap(box)) {
            return false;
        }
        // Squared distance from the centres to the box (Ericson 5.1.3.1).
        const PackedBox::Lanes below = box.low - centers_.high;
        const PackedBox::Lanes above = centers_.low - box.high;
        const PackedBox::Lanes outside = below > above ? below : above;
        const PackedBox::Lanes squared = outside > PackedBox::Lanes{} ? outside * outside : PackedBox::Lanes{};
        return squared[0] + squared[1] + squared[2] <= squared_radius_;
    }

  private:
    SphereLimits(const Aabb& box, const Aabb& centers, double radius) noexcept;

    BoxLimits box_;
    PackedBox centers_;
    float squared_radius_;  // m^2
};

/// The boxes of one leaf.
class LeafBoxes {
  public:
    /// Computes the boxes at the end of the step and, if `when` says so, those of the whole step.
    LeafBoxes(const MovingSurface& surface, std::uint32_t leaf, QueryTime when) noexcept;

    /// Box of triangle k of the leaf.
    [[nodiscard]] const PackedBox& at(QueryTime when, std::size_t k) const noexcept {
        return when == QueryTime::EndOfStep ? end_[k] : whole_[k];
    }

  private:
    Scratch<PackedBox, SweptTree::kMaxInLeaf> end_;
    Scratch<PackedBox, SweptTree::kMaxInLeaf> whole_;
};

}  // namespace haptic::sim
