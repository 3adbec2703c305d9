// How some points have moved since a reference: an affine map, and what it leaves of each.
//
// With x_p = A X_p + b + r_p at any moment of a step, two points of features whose corners are such points are
//
//     |x_p - x_q| >= sigma |X_p - X_q| - |r_p| - |r_q|
//
// apart, where r of a point between corners is at most that of one of these, and sigma is the least stretch of A. On
// straight paths A and r go straight, too, from those of the start to those of the end. So r is at most the greater of
// both, and by the parallelogram law
//
//     sigma^2 >= min(sigma_start^2, sigma_end^2) - |A_end - A_start|^2 / 4.
//
// So whatever turns, flows or is stretched as a whole keeps its features apart, and only bending counts: r grows with
// the square of the size of what is looked at.
// @source our own; fits of affine maps to points: M. Mueller et al., "Meshless Deformations Based on Shape Matching",
// 2005
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "haptic/types.hpp"
#include "simd/deformation.hpp"

namespace haptic::sim {

class Deformation {
  public:
    /// What follow() leaves, of the points in their order.
    struct Residuals {
        std::vector<float> of_point;  // m
        ResidualExtremes most{};
        std::vector<GroupPlaces> end;
        void make_room(std::size_t points);
    };

    /// These points, as they are in `places`, m, are the reference. The groups of the first ones are told apart; the
    /// map is fitted to the groups of so many. Residuals are those of all, so what they tell holds whatever it is
    /// fitted to.
    void refer_to(std::span<const std::uint32_t> points, std::size_t first_points, std::size_t fitted_points,
                  const FloatRow* places);
    /// Distances of points from something, m, when the reference was taken, one for each: Residuals::most tells what
    /// is left of them, and of points that are not farther than `limit`.
    void measure(std::span<const float> distances, float limit) noexcept;
    /// Fits the map to the ends of a step, which starts where the last one that was followed has ended, unless track
    /// was lost. Returns the least stretch over the step, rounded down: not a number, or not positive, where the map
    /// says nothing. Then residuals say nothing either.
    [[nodiscard]] float follow(const DeformationKernels& kernels, const FloatRow* start, const FloatRow* end,
                               Residuals& residuals) noexcept;
    /// The step has been made.
    void advance() noexcept {
        start_ = end_;
        start_is_known_ = true;
    }
    /// Steps have been made that it did not follow.
    void lose_track() noexcept { start_is_known_ = false; }
    /// How the points went as a whole in the step, about: by way + turn x (x - middle).
    struct Motion {
        Vec3 middle{0.0};  // m, at the start
        Vec3 way{0.0};     // m
        Vec3 turn{0.0};    // rad
    };
    [[nodiscard]] Motion motion() const noexcept;

    [[nodiscard]] bool is_empty() const noexcept { return group_.empty(); }
    /// The number of a point.
    [[nodiscard]] std::uint32_t number_of(std::size_t at) const noexcept {
        return group_[at / kPointsInGroup].point[at % kPointsInGroup];
    }
    /// Where it is in the reference, m.
    [[nodiscard]] std::array<float, 3> reference_of(std::size_t at) const noexcept;
    /// m, that the distance of two points may be less than it seems, as references are rounded.
    [[nodiscard]] float rounding() const noexcept { return kRoundingInUnits * unit_; }

    /// For groups besides, and as many as now times some.
    void make_room_for_more(std::size_t groups, std::size_t times);
    /// Fetches what follow() needs.
    void prefetch() const noexcept;

  private:
    // Half a unit along each axis, of two points, and stretched.
    static constexpr float kRoundingInUnits = 4.0F;

    [[nodiscard]] AffineMap map_of(const DeformationSums& sums) const noexcept;
    [[nodiscard]] float least_square_stretch(const AffineMap& map) const noexcept;

    // About the middle of the fitted points, along their axes of inertia, the narrowest first. The last point is
    // repeated to the end of its group.
    std::vector<PointGroup> group_;
    std::size_t first_groups_ = 0;
    std::size_t fitted_groups_ = 0;
    float unit_ = 0.0F;              // m, of the reference
    float limit_ = 0.0F;             // m
    std::array<float, 3> sum_{};     // along the axes, of the fitted points, in units: next to nothing
    std::array<float, 3> spread_{};  // of their squares
    AffineMap start_{};
    AffineMap end_{};
    bool start_is_known_ = false;
};

}  // namespace haptic::sim
