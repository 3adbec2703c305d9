// Relief: a surface seen from above, for a sphere that comes down on it.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "haptic/sim/mesh.hpp"

namespace haptic::sim {

class Relief {
  public:
    /// Samples the surface by one point in each cell of an eighth of the sphere's radius, m.
    Relief(std::span<const Vec3> vertices, std::span<const Triangle> triangles, double radius);

    /// Height of the sphere's centre when it comes down at x and z and touches, m; -infinity if it touches nothing.
    [[nodiscard]] double rest_height(double x, double z) const noexcept;

    /// Where the sphere's centre is when it touches the spot that is nearest to the middle of the surface and least
    /// steep: the least sum of distance over half the surface's length, and slope.
    [[nodiscard]] Vec3 best_spot() const;

  private:
    [[nodiscard]] std::ptrdiff_t column_of(double x) const noexcept;
    [[nodiscard]] std::ptrdiff_t row_of(double z) const noexcept;
    void add(const Vec3& p) noexcept;
    [[nodiscard]] double slope_at(const Vec3& centre) const noexcept;

    double radius_;
    double cell_;  // m
    Vec3 low_{0.0};
    Vec3 high_{0.0};
    std::ptrdiff_t columns_ = 0;
    std::ptrdiff_t rows_ = 0;
    std::vector<Vec3> tops_;  // row by row, the highest sample of each cell; at -infinity if there is none
};

}  // namespace haptic::sim
