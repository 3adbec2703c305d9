// What the parts of the contact code say to one another and to the simulation.
#pragma once

#include <array>
#include <cstdint>

#include <haptic/sim/closest_point.hpp>
#include <haptic/types.hpp>

namespace haptic::sim {

/// How moving surfaces are found by a standing proxy.
enum class CcdMethod : std::uint8_t {
    Complete,  // first touch of every feature, rides swept: secure_position.hpp
    Thesis,    // Algorithm 1 as printed, to compare with: thesis_ccd.hpp
};

/// How a proxy gets clear of what still clips it once all surfaces have arrived.
enum class PopOutMethod : std::uint8_t {
    OrderFree,  // pop_out.hpp
    Thesis      // thesis_pop_out.hpp: Algorithm 2 as printed
};

/// Bounds of the contact code. The defaults are meant to be kept; the bounds of work are met only in states that are
/// reported (`squeezed`).
struct ContactSettings {
    double shrink = 0.999;     // radius for finding contacts over radius for placing (thesis 4.1.4); 0.9 .. 0.99999
    int max_rides = 32;        // moves of one proxy with the surfaces in one step; 4 .. 64
    int max_pop_outs = 32;     // moves at the end of the step until the proxy is clear; 4 .. 64
    int max_proxy_moves = 64;  // moves toward the device in one step; 8 .. 256

    CcdMethod method = CcdMethod::Complete;

    double static_friction = 0.0;   // coefficient, 0 .. 10, that holds a proxy at rest: friction.hpp
    double dynamic_friction = 0.0;  // coefficient, 0 .. static_friction, that brakes one that slides

    PopOutMethod pop_out = PopOutMethod::OrderFree;
    // What follows is for PopOutMethod::Thesis alone.
    int pop_out_limit = 1000;        // passes over the triangles in range, 1 .. 100,000; the most of figure 4.15
    double pop_out_minimum = 0.002;  // of the radius, 0 .. 1: no pop is shorter (4.4.2)
    double detection_range = 2.01;   // of the radius, 1 .. 100: farther triangles are not looked at (not in the thesis)
    bool half_space = false;         // only triangles on whose positive side the centre is (4.6.1)
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
