// Projection onto an intersection of half-spaces: the exact nearest point, by an active-set method.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// Nearest point with its active set and Lagrange multipliers.
struct Projection {
    Vec3 point{0.0};                        // m
    bool feasible = true;                   // false: the half-spaces have no common point; `point` is then the target
    std::uint8_t active_count = 0;          // active half-spaces, at most three
    std::array<std::uint32_t, 3> active{};  // their indices
    std::array<double, 3> multiplier{};     // m, each >= 0: point - target = sum multiplier * normal over them
};

/// Minimises |x - target|^2 over all half-spaces. At most three of them are active at the optimum. So the most violated
/// one is exchanged into the basis until none is violated; this is an LP-type problem, whose distance grows with each
/// exchange. A half-space violated by less than `tolerance` (m) counts as satisfied. No libm, no allocation.
[[nodiscard]] Projection project_onto(std::span<const HalfSpace> half_spaces, const Vec3& target,
                                      double tolerance) HAPTIC_RT;

}  // namespace haptic::sim
