// Workspace walls: soft walls that keep the grip where the strings reach it.
//
// The region is an ellipsoid of positions and a largest angle of rotation. With g(p) = |(x/a, y/b, z/c)|, the depth in
// the wall is d = (g - 1) min(a, b, c), a length whose gradient is at most 1, and the wall is the potential
//     U(d) = F d^2 / (2 t)   up to the thickness t,      U(d) = F (d - t / 2)   beyond,
// so its force -U'(d) grad d is continuous and at most F. The rotation has the same potential of its angle. Both are
// conservative; damping against the motion along the gradient only takes energy. Inside the region all is exactly zero.
#pragma once

#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic::rt {

struct WorkspaceWalls {
    bool on = false;
    Vec3 semi_axes{0.0};             // m, of the ellipsoid at which the wall begins
    double thickness = 0.0;          // m, over which the force grows to its largest
    double force = 0.0;              // N, largest of the spring, and of the damping
    double damping = 1.0;            // N*s/m, where the force is largest
    double angle = 0.0;              // rad, at which the wall of the rotation begins
    double angular_thickness = 0.0;  // rad
    double torque = 0.0;             // N*m
    double angular_damping = 2e-4;   // N*m*s/rad
};

struct WallPush {
    Wrench wrench;
    double stored = 0.0;  // J, U of both walls
    bool pushes = false;  // outside the region
};

/// Wrench of the walls on the grip at this pose and velocity, device frame.
[[nodiscard]] WallPush push_of_walls(const WorkspaceWalls& walls, const Pose& device_from_grip,
                                     const Twist& velocity) HAPTIC_RT;

/// What is left of another wrench beside this push of the walls: its part against them shrinks as they push more, and
/// is gone where they push with all their force, or torque. It changes without a step, so that nothing chatters at the
/// edge; what is along the walls or goes with them stays.
[[nodiscard]] Wrench yielding(const Wrench& wrench, const WallPush& push, const WorkspaceWalls& walls) HAPTIC_RT;

}  // namespace haptic::rt
