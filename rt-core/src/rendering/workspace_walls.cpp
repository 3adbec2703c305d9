#include "rendering/workspace_walls.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace haptic::rt {
namespace {

/// A wall along one coordinate, the depth or the angle.
struct Wall {
    double thickness;
    double force;    // or torque
    double damping;  // at full force
};

/// Push against growing depth, and its energy.
struct Push {
    double force = 0.0;
    double stored = 0.0;
};

/// `rate`: of the depth, per second.
Push push_of(const Wall& wall, double depth, double rate) HAPTIC_RT {
    // Spring: quadratic potential, then linear.
    const double share = std::min(1.0, depth / wall.thickness);
    const double beyond = std::max(0.0, depth - wall.thickness);
    // The damping fades in with the spring, so that the wall's edge is not felt as a blow.
    const double damping = std::clamp(wall.damping * share * rate, -wall.force, wall.force);
    return {.force = wall.force * share + damping,
            .stored = wall.force * (0.5 * share * std::min(depth, wall.thickness) + beyond)};
}

/// One of force and torque; `push` of the walls is at most `largest` where the damping does not act.
Vec3 yielding_part(const Vec3& part, const Vec3& push, double largest) HAPTIC_RT {
    const double size = glm::length(push);
    const double against = size > 0.0 ? -glm::dot(part, push) / size : 0.0;
    if (against <= 0.0) {
        return part;
    }
    return part + std::min(1.0, size / largest) * against / size * push;
}

}  // namespace

WallPush push_of_walls(const WorkspaceWalls& walls, const Pose& device_from_grip, const Twist& velocity) HAPTIC_RT {
    WallPush result;
    if (!walls.on) {
        return result;
    }
    // Position: depth beyond the ellipsoid, and its gradient.
    const Vec3 scaled = device_from_grip.position / walls.semi_axes;
    const double g = glm::length(scaled);
    if (g > 1.0 && std::isfinite(g)) {
        const double shortest = std::min({walls.semi_axes.x, walls.semi_axes.y, walls.semi_axes.z});
        const Vec3 gradient = shortest / g * (scaled / walls.semi_axes);
        const Push push = push_of({walls.thickness, walls.force, walls.damping}, (g - 1.0) * shortest,
                                  glm::dot(gradient, velocity.linear));
        result.wrench.force = -push.force * gradient;
        result.stored += push.stored;
        result.pushes = true;
    }
    // Rotation: the angle grows with the angular velocity about the axis, in the device's frame as in the grip's.
    const Quat& q = device_from_grip.orientation;
    const Vec3 part(q.x, q.y, q.z);
    const double sine = glm::length(part);
    const double angle = 2.0 * std::atan2(sine, std::fabs(q.w));
    if (angle > walls.angle && std::isfinite(sine)) {
        const Vec3 axis = part * ((q.w < 0.0 ? -1.0 : 1.0) / sine);
        const Push push = push_of({walls.angular_thickness, walls.torque, walls.angular_damping}, angle - walls.angle,
                                  glm::dot(axis, velocity.angular));
        result.wrench.torque = -push.force * axis;
        result.stored += push.stored;
        result.pushes = true;
    }
    return result;
}

Wrench yielding(const Wrench& wrench, const WallPush& push, const WorkspaceWalls& walls) HAPTIC_RT {
    if (!push.pushes) {
        return wrench;
    }
    return {yielding_part(wrench.force, push.wrench.force, walls.force),
            yielding_part(wrench.torque, push.wrench.torque, walls.torque)};
}

}  // namespace haptic::rt
