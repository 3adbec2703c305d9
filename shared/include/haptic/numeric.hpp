// Small numeric functions of the real-time code: tests for finite values and unit length, and the smooth step.
#pragma once

#include <algorithm>
#include <cmath>

#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic {

/// Difference from length 1 up to which a vector or quaternion that comes from outside is a unit one.
inline constexpr double kUnitTolerance = 1e-6;

[[nodiscard]] inline bool is_finite(const Vec3& v) HAPTIC_RT {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

[[nodiscard]] inline bool is_finite(const Wrench& wrench) HAPTIC_RT {
    return is_finite(wrench.force) && is_finite(wrench.torque);
}

/// Smooth step 3t^2 - 2t^3 with t = x clamped to 0..1. Value and slope are continuous; the largest slope is 1.5, at
/// 0.5.
[[nodiscard]] inline double smooth_step(double x) HAPTIC_RT {
    const double t = std::clamp(x, 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}

}  // namespace haptic
