#include "haptic/rt/velocity.hpp"

#include <cmath>
#include <glm/geometric.hpp>

namespace haptic::rt {

Vec3 rotation_between(const Quat& from, const Quat& to) HAPTIC_RT {
    Quat turn = to * glm::conjugate(from);
    if (turn.w < 0.0) {
        turn = -turn;  // the same rotation, the shorter way
    }
    const Vec3 axis(turn.x, turn.y, turn.z);
    const double sine = glm::length(axis);
    // angle / sine tends to 2 as the angle vanishes; there the quotient itself would be 0 / 0.
    const double scale = sine > 1e-9 ? 2.0 * std::atan2(sine, turn.w) / sine : 2.0;
    return scale * axis;
}

const Twist& VelocityFilter::update(const Pose& pose, std::int64_t elapsed_ns) HAPTIC_RT {
    if (elapsed_ns > 0) {
        const double dt = seconds(elapsed_ns);
        const double share = dt / (time_constant_s_ + dt);
        const Vec3 linear = (pose.position - last_.position) / dt;
        const Vec3 angular = rotation_between(last_.orientation, pose.orientation) / dt;
        twist_.linear += share * (linear - twist_.linear);
        twist_.angular += share * (angular - twist_.angular);
    }
    last_ = pose;
    return twist_;
}

void VelocityFilter::reset(const Pose& pose) HAPTIC_RT {
    last_ = pose;
    twist_ = Twist{};
}

}  // namespace haptic::rt
