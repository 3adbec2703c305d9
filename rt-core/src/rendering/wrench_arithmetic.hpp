// Arithmetic of wrenches about the same position.
#pragma once

#include <algorithm>
#include <glm/geometric.hpp>

#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic::rt {

inline bool is_zero(const Wrench& wrench) HAPTIC_RT {
    return wrench.force == Vec3(0.0) && wrench.torque == Vec3(0.0);
}

inline Wrench sum(const Wrench& one, const Wrench& other) HAPTIC_RT {
    return {one.force + other.force, one.torque + other.torque};
}

inline Wrench difference(const Wrench& one, const Wrench& other) HAPTIC_RT {
    return {one.force - other.force, one.torque - other.torque};
}

inline Wrench scaled(double factor, const Wrench& wrench) HAPTIC_RT {
    return {factor * wrench.force, factor * wrench.torque};
}

/// N plus N*m, a measure of how much is left of a wrench that was shortened.
inline double size_of(const Wrench& wrench) HAPTIC_RT {
    return glm::length(wrench.force) + glm::length(wrench.torque);
}

/// Part of a wrench after the whole was shortened, force and torque by a factor of at most 1 each.
inline Wrench shortened(const Wrench& part, const Wrench& whole, const Wrench& whole_now) HAPTIC_RT {
    const auto ratio = [](const Vec3& before, const Vec3& now) HAPTIC_RT {
        const double length = glm::length(before);
        return length > 0.0 ? std::min(1.0, glm::length(now) / length) : 0.0;
    };
    return {ratio(whole.force, whole_now.force) * part.force, ratio(whole.torque, whole_now.torque) * part.torque};
}

}  // namespace haptic::rt
