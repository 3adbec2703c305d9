// What the parts of the contact code say to one another and to the simulation.
#pragma once

#include <array>
#include <cstdint>

#include "haptic/sim/contact/closest_point.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// Bounds of the contact code. The defaults are meant to be kept; the bounds of work are met only in states that are
/// reported (`squeezed`).
struct ContactSettings {
    double shrink = 0.999;     // radius for finding contacts over radius for placing (thesis 4.1.4); 0.9 .. 0.99999
    int max_rides = 32;        // moves of one proxy with the surfaces in one step; 4 .. 64
    int max_pop_outs = 32;     // moves at the end of the step until the proxy is clear; 4 .. 64
    int max_proxy_moves = 64;  // moves toward the device in one step; 8 .. 256
};

/// A point of a surface, by material.
struct SurfacePoint {
    std::uint32_t object = 0;    // index into the span of surfaces
    std::uint32_t triangle = 0;  // of that surface
    Feature feature = Feature::None;
    Vec3 weights{1.0, 0.0, 0.0};  // barycentric, of the touched point
};

/// A half-space for the centre of a proxy: dot(normal, centre) >= offset. The proxy's radius is in the offset.
struct SurfacePlane {
    Vec3 normal{0.0, 1.0, 0.0};  // unit, from the surface to the proxy
    double offset = 0.0;         // m, at the end of the step
    double velocity = 0.0;       // m/s, of the surface along the normal
    SurfacePoint touched;
};

inline constexpr std::size_t kMaxSurfacePlanes = 3;

struct SurfacePlanes {
    std::array<SurfacePlane, kMaxSurfacePlanes> plane{};
    std::uint32_t count = 0;
};

}  // namespace haptic::sim
