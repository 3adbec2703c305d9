// Uncovered depth: an upper bound of the distance from any point of some triangles to the nearest of a set of balls.
#pragma once

#include <limits>
#include <span>

#include "haptic/sim/closest_point.hpp"
#include "haptic/types.hpp"
#include "tool/sphere_cover.hpp"

namespace haptic::sim {

/// Resolution of a cover's depth, as a part of the size of what is covered.
inline constexpr double kCoverResolution = 1e-4;

/// Branch and bound. The distance from a ball is convex, so over a triangle it is greatest at a corner; the smallest
/// such maximum over the balls bounds the triangle's distance from their union. Triangles are bisected until the bound
/// is close to the greatest distance found at a corner.
class UncoveredDepth {
  public:
    /// The bound exceeds the true value by at most `resolution` (m), or 1 % if that is more. `balls`: at least one;
    /// they must outlive this object.
    UncoveredDepth(std::span<const Ball> balls, double resolution) : balls_(balls), resolution_(resolution) {}

    /// Includes a triangle; it may be degenerate, a segment or a point.
    void add(const TriangleCorners& triangle) { add(triangle, 0); }

    /// m, upper bound over all triangles so far; negative if all their points are inside balls.
    [[nodiscard]] double bound() const noexcept { return bound_; }
    /// m, the greatest distance found at a point: a lower bound.
    [[nodiscard]] double max_seen() const noexcept { return max_seen_; }
    /// The point with that distance.
    [[nodiscard]] const Vec3& farthest() const noexcept { return farthest_; }

  private:
    void add(const TriangleCorners& triangle, int divisions);
    void measure(const Vec3& p);

    std::span<const Ball> balls_;
    double resolution_;
    double max_seen_ = -std::numeric_limits<double>::infinity();
    double bound_ = -std::numeric_limits<double>::infinity();
    Vec3 farthest_{0.0};
};

}  // namespace haptic::sim
