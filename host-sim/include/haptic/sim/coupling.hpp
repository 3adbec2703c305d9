// Coupling between hip and proxies: the virtual spring, its damping, and how a tool's particles share it.
#pragma once

#include <cstdint>

namespace haptic::sim {

/// Content of a contact frame for each particle in contact.
enum class MultiRate : std::uint8_t {
    Planes,    // the contact planes that hold each particle, and speculative planes in reach
    Positions  // particle positions, the thesis' scheme (section 5.4.1), for comparison: it drags
};

/// How the particles of a tool share the force.
enum class ForceSharing : std::uint8_t {
    All,    // each particle gets the spring divided by the number of all particles (thesis, section 5.2.2)
    Series  // in series with springs of the grip, so that the number of particles matters little: series_springs.hpp
};

/// Spring and Hunt-Crossley damper between hip and proxy, in the scene. Equations: contact_force.hpp.
struct Coupling {
    double stiffness = 20.0;             // N/m
    double hunt_crossley_damping = 0.0;  // s/m, c in F = k d (1 + c v)
    double tied_mass = 0.0;              // kg, surface that follows the pressed patch within a step; 0: unknown
};

struct CouplingSettings : Coupling {
    double torque_stiffness = 0.0;  // N/m, of the springs that make the torque; 0: the same as `stiffness`
    ForceSharing share = ForceSharing::All;
    MultiRate multi_rate = MultiRate::Planes;
    double mask_radius = 0.1;  // m, rest shape: radius of the pressure mask about the contact
};

}  // namespace haptic::sim
