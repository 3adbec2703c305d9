// Anderson acceleration of a fixed-point iteration x <- g(x): the next x combines the last results g(x_j) so that the
// change g(x) - x, taken as linear between the last iterates, is smallest.
//
// Gauss-Seidel over the contacts of a stiff tool converges slowly along the few motions that all contacts share. In
// those directions the iteration is nearly linear, and as many iterates as directions are enough.
// @source D. Anderson, "Iterative procedures for nonlinear integral equations", 1965; type II as in H. Walker, P. Ni,
// "Anderson acceleration for fixed-point iterations", 2011.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "haptic/realtime.hpp"

namespace haptic {

class AndersonAcceleration {
  public:
    /// Allocates for vectors of at most `capacity` elements.
    explicit AndersonAcceleration(std::size_t capacity);

    /// Forgets all iterates.
    void restart() HAPTIC_RT { iterates_ = 0; }
    /// After an application of g: `change` is g(x) - x, scaled so that its elements are comparable; `result` is g(x)
    /// and becomes the next x. `image`, an affine function of x evaluated at g(x), follows it. All of equal size.
    void extrapolate(std::span<const double> change, std::span<double> result, std::span<double> image) HAPTIC_RT;
    /// Restores what the last extrapolate() was given.
    void undo(std::span<double> result, std::span<double> image) const HAPTIC_RT;

    static constexpr std::size_t kDepth = 5;  // differences of iterates that are kept

  private:
    /// One of the kept differences, or the last values.
    struct Vectors {
        std::vector<double> change;
        std::vector<double> result;
        std::vector<double> image;
    };

    std::array<Vectors, kDepth> differences_;  // ring: difference j is at j % kDepth
    Vectors last_;
    std::array<std::array<double, kDepth>, kDepth> products_{};  // of the differences' changes
    std::size_t iterates_ = 0;                                   // since the restart
};

}  // namespace haptic
