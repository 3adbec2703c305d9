// Ranges of a model's keys, in a scene and in a model file: beyond any scene that the solver is meant for, so that a
// typing error is refused instead of costing an hour of computing.
#pragma once

#include "haptic/config.hpp"

namespace haptic::sim {

inline constexpr Range kPositions{-1e4, 1e4};   // m
inline constexpr Range kSizes{0.0, 1e4};        // m
inline constexpr Range kVelocities{-1e3, 1e3};  // m/s
inline constexpr Range kMasses{1e-12, 1e6};     // kg
inline constexpr Range kUnitInterval{0.0, 1.0};
inline constexpr Range kCompliances{0.0, 1e6};

}  // namespace haptic::sim
