// Settings and results shared by the contact code and the simulation.
#pragma once

#include <array>
#include <cstdint>

#include "haptic/sim/closest_point.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// How a proxy at rest detects moving surfaces.
enum class CcdMethod : std::uint8_t {
    Complete,  // first contact of every feature, advances swept: secure_position.hpp
    Thesis,    // Algorithm 1 of the thesis as printed, for comparison: thesis_ccd.hpp
};

/// How a proxy gets clear of surfaces that still clip it at the end of the step.
enum class PopOutMethod : std::uint8_t {
    OrderFree,  // pop_out.hpp
    Thesis      // Algorithm 2 of the thesis as printed, for comparison: thesis_pop_out.hpp
};

/// Settings of the contact code. The defaults should be kept. The limits on iterations are reached only in states that
/// are reported (`overconstrained`).
struct ContactSettings {
    double shrink = 0.999;     // radius that finds contacts over radius that positions (thesis 4.1.4); 0.9 .. 0.99999
    int max_advances = 32;     // advances of one proxy with the surfaces in one step; 4 .. 64
    int max_pop_outs = 32;     // moves at the end of the step until the proxy is clear; 4 .. 64
    int max_proxy_moves = 64;  // moves toward the device in one step; 8 .. 256

    CcdMethod method = CcdMethod::Complete;

    double static_friction = 0.0;   // coefficient, 0 .. 10, for a proxy at rest: haptic/contact_problem.hpp
    double dynamic_friction = 0.0;  // coefficient, 0 .. static_friction, for a sliding proxy

    PopOutMethod pop_out = PopOutMethod::OrderFree;
    // Only for PopOutMethod::Thesis:
    int pop_out_limit = 1000;        // passes over the triangles in range, 1 .. 100,000; maximum of figure 4.15
    double pop_out_minimum = 0.002;  // of the radius, 0 .. 1: shortest pop (4.4.2)
    double detection_range = 2.01;   // of the radius, 1 .. 100: farther triangles are skipped (value not in the thesis)
    bool half_space = false;         // only triangles on whose positive side the centre is (4.6.1)
};

/// Material point of a surface.
struct SurfacePoint {
    std::uint32_t object = 0;    // index into the surfaces
    std::uint32_t triangle = 0;  // index into the surface's triangles
    Feature feature = Feature::None;
    Vec3 weights{1.0, 0.0, 0.0};  // barycentric
};

/// Contact plane: a half-space for the centre of a proxy, dot(normal, centre) >= offset. The offset includes the
/// proxy's radius.
struct SurfacePlane {
    Vec3 normal{0.0, 1.0, 0.0};  // unit, from the surface to the proxy
    double offset = 0.0;         // m, at the end of the step
    double velocity = 0.0;       // m/s, of the surface along the normal
    SurfacePoint touched;
};

// At most three planes are active at a minimum of the distance to the goal.
inline constexpr std::size_t kMaxSurfacePlanes = 3;

struct SurfacePlanes {
    std::array<SurfacePlane, kMaxSurfacePlanes> plane{};
    std::uint32_t count = 0;
};

/// Force of a surface on a proxy of the tool, mean over a step.
struct SurfaceForce {
    std::uint32_t proxy = 0;
    SurfacePlane plane;
    bool touches = false;  // the plane is a contact of the proxy's; otherwise it may only press within the step
    double force = 0.0;    // N, normal
};

}  // namespace haptic::sim
