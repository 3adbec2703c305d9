// How far the points of triangles are from the nearest of some balls, at most: a bound for every point.
#pragma once

#include <limits>
#include <span>

#include <haptic/sim/closest_point.hpp>
#include "tool/sphere_cover.hpp"
#include <haptic/types.hpp>

namespace haptic::sim {

/// The distance from a ball is convex, so over a triangle it is greatest in a corner, and that of the ball whose
/// farthest corner is nearest bounds what the triangle misses. Triangles are halved until that bound is close to what
/// was seen.
class BareDepth {
  public:
    /// `finest`, m, or 1 % where that is more: how much the bound may exceed what is. The balls, at least one, must
    /// outlive it.
    BareDepth(std::span<const Ball> balls, double finest) : balls_(balls), finest_(finest) {}

    /// Takes a triangle in; it may be a segment or a point.
    void take(const TriangleCorners& triangle) { take(triangle, 0); }

    /// m, of all triangles taken so far; negative if they are inside balls, the least deep point by that much.
    [[nodiscard]] double bound() const noexcept { return bound_; }
    /// m, of the point that was seen to be farthest away.
    [[nodiscard]] double seen() const noexcept { return seen_; }
    [[nodiscard]] const Vec3& farthest() const noexcept { return farthest_; }

  private:
    void take(const TriangleCorners& triangle, int divisions);
    void look_at(const Vec3& p);

    std::span<const Ball> balls_;
    double finest_;
    double seen_ = -std::numeric_limits<double>::infinity();
    double bound_ = -std::numeric_limits<double>::infinity();
    Vec3 farthest_{0.0};
};

}  // namespace haptic::sim
