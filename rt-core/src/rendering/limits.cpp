#include "rendering/limits.hpp"

#include <cmath>
#include <glm/geometric.hpp>

#include "haptic/numeric.hpp"

namespace haptic::rt {
namespace {

/// Shortens v to at most `max_length`. Returns true if it was longer.
bool shorten(Vec3& v, double max_length) HAPTIC_RT {
    const double length = glm::length(v);
    if (length <= max_length) {
        return false;
    }
    // If the squared length overflowed, the direction is lost: zero.
    v = std::isfinite(length) ? v * (max_length / length) : Vec3(0.0);
    return true;
}

/// Replaces `to` by the point at most `distance` from `from` towards it. Returns true if `to` was farther.
bool approach(const Vec3& from, Vec3& to, double distance) HAPTIC_RT {
    Vec3 step = to - from;
    if (!shorten(step, distance)) {
        return false;
    }
    to = from + step;
    return true;
}

}  // namespace

WrenchLimiter::Result WrenchLimiter::apply(const Wrench& wanted, std::int64_t elapsed_ns) HAPTIC_RT {
    Result result;
    result.wrench.force = is_finite(wanted.force) ? wanted.force : Vec3(0.0);
    result.wrench.torque = is_finite(wanted.torque) ? wanted.torque : Vec3(0.0);

    // Size, keeping the direction.
    const bool force_large = shorten(result.wrench.force, limits_.force);
    const bool torque_large = shorten(result.wrench.torque, limits_.torque);
    result.size_limited = force_large || torque_large;

    // Rate. Both ends of the step lie in the ball of the size limit, which is convex, so the result does too.
    const double dt = seconds(elapsed_ns);
    const bool force_fast = approach(last_.force, result.wrench.force, limits_.force_rate * dt);
    const bool torque_fast = approach(last_.torque, result.wrench.torque, limits_.torque_rate * dt);
    result.rate_limited = force_fast || torque_fast;

    last_ = result.wrench;
    return result;
}

}  // namespace haptic::rt
