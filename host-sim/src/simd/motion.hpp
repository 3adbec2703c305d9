// Motion kernels: velocities of particles at the end of a sub-step, and the momenta of bodies. The equations are in
// haptic/sim/solver.hpp.
//
// The x, y and z of a particle are computed side by side, and sums over particles are added one after the other, so the
// bits do not depend on the width of the registers.
#pragma once

#include <cstddef>
#include <cstdint>

#include "simd/projection.hpp"

namespace haptic::sim {

/// Particles that have moved in a sub-step. Arrays have shape [particle]; vectors x, y, z are not padded.
struct MovedParticles {
    std::size_t count;
    double step;                   // s, h
    const std::uint8_t* pinned;    // these keep their velocities
    const double* start;           // m, x
    const Row* position;           // m, u
    const Row* angular_velocity;   // rad/s
    const Row* pushed;             // m, displacement by contacts; null: none
    double* predicted;             // m/s, by forces, in; and contacts, out
    double* velocity;              // m/s, out
    double* new_angular_velocity;  // rad/s, out
};

/// A body that is free to move as a whole, at the end of a sub-step. Arrays as in MovedParticles.
struct FreeBody {
    std::size_t count;
    double step;
    bool keep_angular_momentum;
    const double* mass;       // kg
    const double* start;      // m
    const double* predicted;  // m/s, velocities with the momenta that the body should have
    double* velocity;         // m/s, in and out
    Row* position;            // m, in and out
};

/// Motion kernels for one number of lanes.
struct MotionKernels {
    std::size_t lanes;
    /// v <- (u - x) / h; predicted <- predicted + pushed / h.
    void (*find_velocities)(const MovedParticles& particles) noexcept;
    /// Adds the momenta that the body has lost as a rigid motion, to velocities and positions.
    void (*restore_momenta)(const FreeBody& body) noexcept;
};

}  // namespace haptic::sim
