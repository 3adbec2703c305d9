// The point of an intersection of half-spaces that is nearest to a given point, exactly.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include <haptic/realtime.hpp>
#include <haptic/types.hpp>

namespace haptic::sim {

struct Projection {
    Vec3 point{0.0};
    bool feasible = true;                   // false: no point is in all half-spaces; `point` is then the target
    std::uint8_t active_count = 0;          // half-spaces that hold the point, at most three
    std::array<std::uint32_t, 3> active{};  // their indices
    std::array<double, 3> multiplier{};     // m, each >= 0: point - target = sum multiplier * normal over them
};

/// Minimises |x - target|^2 over all half-spaces. The optimum is held by at most three of them, so the most violated
/// one is exchanged into the basis until none is violated (an LP-type problem: the distance grows with each exchange).
/// A half-space counts as satisfied when violated by less than `tolerance` (m). No libm, no allocation.
[[nodiscard]] Projection project_onto(std::span<const HalfSpace> half_spaces, const Vec3& target,
                                      double tolerance) HAPTIC_RT;

}  // namespace haptic::sim
