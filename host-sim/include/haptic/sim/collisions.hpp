// Collisions of particles of different bodies, as ellipsoids, and of all particles with the ground (thesis, Algorithm
// 3, EllipsoidCollisionDetections).
#pragma once

#include "haptic/sim/particles.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

struct CollisionSettings {
    bool between_bodies = true;
    bool ground = false;            // the half-space below ground_height is solid
    double ground_height = 0.0;     // m
    double static_friction = 0.0;   // coefficients, 0 .. 10
    double dynamic_friction = 0.0;  // at most the static one
};

}  // namespace haptic::sim
