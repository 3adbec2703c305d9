// Local proxy: the point nearest to the device that up to three half-spaces allow, recomputed at the haptic rate.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic {

struct LocalProxy {
    Vec3 position{0.0, 0.0, 0.0};  // m
    std::uint8_t active = 0;       // bit k: plane k holds the proxy; if feasible, the proxy lies on it
    bool feasible = true;          // false: no point satisfies all planes; position minimises the largest violation
    // m, each >= 0: position - target = sum multiplier[k] normal[k]. All 0 if infeasible.
    std::array<double, kMaxPlanes> multiplier{};
};

/// Projects target onto the intersection of half-spaces: exact minimiser of |x - target|^2, by enumeration of the
/// active sets (at most eight). At most kMaxPlanes planes; further ones are ignored. Independent of their order up to
/// rounding. Constant time.
///
/// Opposing planes that meet only 100 times their overlap away (an opening angle of half a degree) count as infeasible:
/// a proxy that jumped there would be felt as an impact. In the infeasible case the position is the point of least
/// violation nearest to the target: half-way for two opposing planes, and similarly for three that form a closed prism.
/// A target or plane that is not finite or beyond 1e6 m gives no contact: position is the target if usable, else the
/// origin, and feasible is false.
[[nodiscard]] LocalProxy project(const Vec3& target, std::span<const HalfSpace> planes) HAPTIC_RT;

}  // namespace haptic
