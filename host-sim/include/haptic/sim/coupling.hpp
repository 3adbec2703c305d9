// Coupling between hip and proxies: the virtual spring and its damping.
#pragma once

#include <cstdint>

namespace haptic::sim {

/// Content of a contact frame for each particle in contact.
enum class MultiRate : std::uint8_t {
    Planes,    // the contact planes that hold each particle, and speculative planes in reach
    Positions  // particle positions, the thesis' scheme (section 5.4.1), for comparison: it drags
};

/// Spring and dampers between hip and proxy, in the scene. Equations: tool/contact_coupling.hpp.
struct CouplingSettings {
    double stiffness = 20.0;             // N/m
    double hunt_crossley_damping = 0.0;  // s/m, c in F = k d (1 + c v)
    double damping_time = 0.0;           // s, ratio of damping to stiffness of a damper beside the spring
    double torque_stiffness = 0.0;       // N/m, of the springs that make the torque; 0: the same as `stiffness`
    MultiRate multi_rate = MultiRate::Planes;
    double mask_radius = 0.1;  // m, rest shape: radius of the pressure mask about the contact
};

}  // namespace haptic::sim
