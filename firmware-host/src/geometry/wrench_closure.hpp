// What eight strings that only pull can do to a grip: whether they can make every wrench, and how much of one.
//
// At a pose the tensions t make the wrench A^T t, A the wire matrix (8 x 6, row i is [u_i, r_i x u_i]: unit vector from
// knot to motor, its moment about the grip's origin). Where A has rank 6, the tensions that make a wrench w are
// t_w + N z, N (8 x 2) a basis of the tensions that cancel. All questions here are then linear programmes of three
// unknowns with few constraints, solved exactly (to rounding) by trying each vertex. For the cold path.
// @source Roberts, Graham and Lippitt 1998, "On the inverse kinematics, statics, and fault tolerance of cable-suspended
// robots", for wrench closure as positive tensions in the null space.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <haptic/device/variant.hpp>
#include <haptic/types.hpp>

namespace haptic::device {

/// Force (N) and torque (N*m) on the grip, device frame.
using WrenchVector = std::array<double, 6>;

struct WrenchClosure {
    bool determined = false;  // A has rank 6: the lengths determine the pose
    // Of tensions that cancel, the least over the largest, at the best choice of them: 0..1. More than 0:
    // wrench-closed, the strings make every wrench if only they may pull hard enough. 1: eight equal tensions cancel.
    double evenness = 0.0;
    // Signed axes of force and torque that no tensions make without another component: "+Fx", ... "-Tz". Empty if
    // wrench-closed.
    std::vector<std::string> missing;

    [[nodiscard]] bool closed() const { return evenness > 0.0; }
};

[[nodiscard]] WrenchClosure wrench_closure(const Variant& variant, const Pose& device_from_grip);

/// The largest factor on a wrench that tensions within the variant's bounds still make, exactly and with nothing beside
/// it. Nothing if they make no multiple of it, zero included.
[[nodiscard]] std::optional<double> wrench_reach(const Variant& variant, const Pose& device_from_grip,
                                                 const WrenchVector& direction);

}  // namespace haptic::device
