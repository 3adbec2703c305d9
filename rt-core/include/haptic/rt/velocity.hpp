// Velocity of the grip from its poses: difference quotient and a first-order low pass.
#pragma once

#include <cstdint>

#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic::rt {

/// Rotation from one unit quaternion to another as a vector (axis times angle, rad), by the shorter way.
[[nodiscard]] Vec3 rotation_between(const Quat& from, const Quat& to) HAPTIC_RT;

class VelocityFilter {
  public:
    /// time_constant_s: s, of the low pass. 0 switches it off. Ball-park 0.004: one encoder count a millisecond is
    /// 17 mm/s, and more lag than a few milliseconds would take the phase that damping needs.
    explicit VelocityFilter(double time_constant_s) : time_constant_s_(time_constant_s) {}

    /// Takes the pose measured elapsed_ns after the last one. With elapsed_ns <= 0 the pose is taken and the velocity
    /// stays.
    const Twist& update(const Pose& pose, std::int64_t elapsed_ns) HAPTIC_RT;
    /// At rest at a pose.
    void reset(const Pose& pose) HAPTIC_RT;
    [[nodiscard]] const Twist& twist() const HAPTIC_RT { return twist_; }

  private:
    double time_constant_s_;
    Pose last_;
    Twist twist_;
};

}  // namespace haptic::rt
