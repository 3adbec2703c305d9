// Motion kernels: where forces lead particles in a sub-step, their velocities at its end, and the momenta of bodies.
// The equations are in haptic/sim/solver.hpp.
//
// The x, y and z of a particle are computed side by side, and sums over particles are added one after the other, so the
// bits do not depend on the width of the registers.
#pragma once

#include <cstddef>
#include <cstdint>

#include "simd/projection.hpp"

namespace haptic::sim {

/// Particles at the beginning of a sub-step. Arrays have shape [particle]; vectors x, y, z and quaternions x, y, z, w
/// are not padded.
struct StartingParticles {
    std::size_t count;
    double step;                     // s, h
    double drag_factor;              // of both velocities
    const double* gravity;           // m/s^2, x, y, z
    const std::uint8_t* pinned;      // these follow their velocities
    const double* mass;              // kg
    const double* force;             // N; null: none
    const double* start;             // m, x
    const double* velocity;          // m/s
    const double* angular_velocity;  // rad/s
    const double* orientation;
    double* predicted;  // m/s, out: v with forces
    Row* position;      // m, out: u; the fourth number stays
    Row* before;        // w, x, y, z, out: orientation
    Row* turning;       // w, x, y, z, out: the same, to be rotated
    Row* rotation;      // rad, out: h w
};

/// Particles that have moved in a sub-step. Arrays have shape [particle]; vectors x, y, z are not padded.
struct MovedParticles {
    std::size_t count;
    double step;                   // s, h
    const std::uint8_t* pinned;    // these keep their velocities
    const double* start;           // m, x
    const Row* position;           // m, u
    const Row* angular_velocity;   // rad/s
    Row* pushed;                   // m, displacement by contacts, in; 0, out
    double* predicted;             // m/s, by forces, in; and contacts, out
    double* velocity;              // m/s, out
    double* new_angular_velocity;  // rad/s, in and out
    const Row* orientation;        // w, x, y, z
    double* new_orientation;       // x, y, z, w, out; pinned particles without rotation keep theirs
};

/// A body that is free to move as a whole. Arrays as in MovedParticles.
struct FreeBody {
    std::size_t count;
    double step;
    bool keep_angular_momentum;
    const double* mass;       // kg
    const double* start;      // m
    const double* predicted;  // m/s, velocities with the momenta that the body should have
    double* velocity;         // m/s, (u - x) / h, in and out; null: nobody needs it yet
    Row* position;            // m, in and out
};

/// Motion kernels for one number of lanes.
struct MotionKernels {
    std::size_t lanes;
    /// v <- v + h (f / m + g), u <- x + h v, and h w.
    void (*predict)(const StartingParticles& particles) noexcept;
    /// v <- (u - x) / h; predicted <- predicted + pushed / h; pushed <- 0.
    void (*find_velocities)(const MovedParticles& particles) noexcept;
    /// Adds the momenta that the body has lost on its way from x to u as a rigid motion, to velocities and positions.
    void (*restore_momenta)(const FreeBody& body) noexcept;
};

}  // namespace haptic::sim
