// Rigid-body types shared by both processes.
//
// SI units throughout: m, rad, s, N, N*m. Coordinate frames are right-handed, y up. A pose `world_from_grip` maps a
// point from the grip frame to the world frame: p_world = orientation * p_grip + position. Times are std::int64_t
// nanoseconds of CLOCK_MONOTONIC with the suffix _ns.
#pragma once

#include <cstdint>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

namespace haptic {

using Vec3 = glm::dvec3;
using Mat3 = glm::dmat3;  // column-major: m[column][row]
using Quat = glm::dquat;  // constructed and written as (w, x, y, z)

struct Pose {
    Vec3 position{0.0, 0.0, 0.0};          // m
    Quat orientation{1.0, 0.0, 0.0, 0.0};  // unit
};

struct Twist {
    Vec3 linear{0.0, 0.0, 0.0};   // m/s
    Vec3 angular{0.0, 0.0, 0.0};  // rad/s, world frame
};

struct Wrench {
    Vec3 force{0.0, 0.0, 0.0};   // N
    Vec3 torque{0.0, 0.0, 0.0};  // N*m about the pose's position, world frame
};

/// The points x with dot(normal, x) >= offset.
struct HalfSpace {
    Vec3 normal{0.0, 1.0, 0.0};  // of unit length
    double offset = 0.0;         // m
};

inline constexpr std::int64_t kNanosecondsPerSecond = 1'000'000'000;

/// Seconds of a time difference in nanoseconds.
constexpr double seconds(std::int64_t duration_ns) noexcept {
    return static_cast<double>(duration_ns) * 1e-9;
}

/// Nanoseconds of a time in seconds, rounded to nearest; |time_s| below 9e9.
constexpr std::int64_t nanoseconds(double time_s) noexcept {
    const double ns = time_s * 1e9;
    return static_cast<std::int64_t>(ns < 0.0 ? ns - 0.5 : ns + 0.5);
}

}  // namespace haptic
