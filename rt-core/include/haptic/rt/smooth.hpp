// The shape of every ramp and fade.
#pragma once

#include <algorithm>

#include "haptic/realtime.hpp"

namespace haptic::rt {

/// Smooth step 3x^2 - 2x^3 of x clamped to 0..1: no jump of the value or of its rate at either end; steepest, 1.5, in
/// the middle.
[[nodiscard]] inline double smooth_step(double x) HAPTIC_RT {
    const double t = std::clamp(x, 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}

}  // namespace haptic::rt
