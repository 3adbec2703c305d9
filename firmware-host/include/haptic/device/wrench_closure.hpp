// Wrench closure: the wrenches that eight strings, which only pull, can exert on the grip.
//
// At a pose, tensions t exert the wrench A^T t. A is the wire matrix (8 x 6); its row i is [u_i, r_i x u_i]: the unit
// vector from knot to motor, and its moment about the grip's origin. If A has rank 6, the tensions of a wrench w are
// t_w + N z, where the columns of N (8 x 2) span the null space of A^T, the tensions that cancel. Each question below
// is then a linear programme with three unknowns and few constraints, solved exactly (to rounding) by enumerating its
// vertices. For the cold path.
// @source Roberts, Graham and Lippitt 1998, "On the inverse kinematics, statics, and fault tolerance of cable-suspended
// robots": wrench closure as positive tensions in the null space.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "haptic/device/device_geometry.hpp"
#include "haptic/types.hpp"

namespace haptic::device {

/// Force (N) and torque (N*m) on the grip, device frame.
using WrenchVector = std::array<double, 6>;

struct WrenchClosure {
    bool determined = false;  // A has rank 6: the lengths determine the pose
    // Largest ratio of smallest to largest tension over all tensions that cancel, 0..1. Positive: the pose is
    // wrench-closed, the strings can exert every wrench if they may pull hard enough. 1: eight equal tensions cancel.
    double tension_factor = 0.0;
    // Signed axes of force and torque that no tensions exert without another component: "+Fx", ... "-Tz". Empty if
    // wrench-closed.
    std::vector<std::string> missing;

    [[nodiscard]] bool closed() const { return tension_factor > 0.0; }
};

[[nodiscard]] WrenchClosure wrench_closure(const DeviceGeometry& geometry, const Pose& device_from_grip);

/// Largest factor of a wrench that tensions within the geometry's limits exert exactly, without any other component.
/// Empty if no multiple of it is possible, zero included.
[[nodiscard]] std::optional<double> wrench_reach(const DeviceGeometry& geometry, const Pose& device_from_grip,
                                                 const WrenchVector& direction);

/// Share of its reach that a device needs for a wrench: 1 / wrench_reach, above 1 if the wrench is out of reach. Empty
/// if no positive multiple of it is possible, as for no wrench.
[[nodiscard]] std::optional<double> share_of_reach(const DeviceGeometry& geometry, const Pose& device_from_grip,
                                                   const Wrench& wrench);

}  // namespace haptic::device
