// Reachable region: poses at which the strings can push the grip in every direction and none of them jams.
//
// At a pose the tensions tmin <= t <= tmax exert the wrenches A^T t, a zonotope in six dimensions. Its margin, the
// largest wrench that it contains in every direction, is the smallest distance of a facet from zero. Each facet's
// normal is orthogonal to five of the eight columns, so all 56 candidates are tried. Torques count by the radius of the
// grip. For the cold path: some tenths of a second.
// @source Bouchard, Gosselin and Moore 2010, On the ability of a cable-driven robot to generate a prescribed set of
// wrenches (hyperplane shifting).
#pragma once

#include "haptic/device/device_geometry.hpp"
#include "haptic/types.hpp"

namespace haptic::rt {

/// N: largest force, with radius times as much torque, that the strings exert in every direction of force and torque
/// together. Negative if they cannot even balance their own minimum tensions.
[[nodiscard]] double wrench_margin(const device::DeviceGeometry& geometry, const Pose& device_from_grip);

struct ReachableRegion {
    Vec3 semi_axes{0.0};  // m, of an ellipsoid about the centre; 0: there is no such region
    double angle = 0.0;   // rad, of any rotation about any axis

    [[nodiscard]] bool empty() const { return semi_axes.x <= 0.0; }
};

/// An ellipsoid and an angle within which, wherever it was sampled, the strings can push in every direction (with a
/// margin of at least a twentieth of that at the centre), and no string is shorter than a quarter of its length there.
/// The angle is half of what the centre alone allows, which leaves room for positions. Empty for a geometry that is not
/// wrench-closed at its centre.
[[nodiscard]] ReachableRegion reachable_region(const device::DeviceGeometry& geometry);

}  // namespace haptic::rt
