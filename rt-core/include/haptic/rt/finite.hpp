// Whether numbers are numbers.
#pragma once

#include <cmath>

#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic::rt {

[[nodiscard]] inline bool finite(const Vec3& v) HAPTIC_RT {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

[[nodiscard]] inline bool finite(const Wrench& wrench) HAPTIC_RT {
    return finite(wrench.force) && finite(wrench.torque);
}

}  // namespace haptic::rt
