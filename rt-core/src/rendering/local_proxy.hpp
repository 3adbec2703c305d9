// The proxy of the haptic rate: the point nearest to the device that up to three half-spaces allow.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include <haptic/frames.hpp>
#include <haptic/realtime.hpp>
#include <haptic/types.hpp>

namespace haptic::rt {

struct LocalProxy {
    Vec3 position{0.0, 0.0, 0.0};  // m
    std::uint8_t active = 0;       // bit k: plane k holds the proxy, the proxy lies on it (if feasible)
    bool feasible = true;          // false: the planes leave no point; position then minimises the largest violation
};

/// Exact minimiser of |x - target|^2 over the half-spaces, by enumeration of the active sets (at most eight), not by
/// iteration. At most kMaxPlanes planes, further ones are ignored. Independent of their order up to rounding.
///
/// Planes that face one another and open so little that they meet only 100 times their overlap away (half a degree)
/// count as leaving no point: a proxy that leapt to where they meet would be felt as a blow. Where no point is left,
/// the position is that of least violation nearest to the target, for normals that oppose (a slit: half-way) as for
/// three that close a prism. With a target or plane that is not finite or beyond 1e6 m nothing is held: position is the
/// target if that is usable, else the origin, and feasible is false.
[[nodiscard]] LocalProxy project(const Vec3& target, std::span<const HalfSpace> planes) HAPTIC_RT;

/// The half-space that a contact plane stands for at a time: its offset moved on by its velocity, for at most
/// `horizon_ns` after plane_time_ns and not before it.
[[nodiscard]] HalfSpace plane_at(const ContactPlane& plane, std::int64_t plane_time_ns, std::int64_t time_ns,
                                 std::int64_t horizon_ns) HAPTIC_RT;

}  // namespace haptic::rt
