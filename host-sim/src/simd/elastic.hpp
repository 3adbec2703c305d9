// Elastic kernels: the forces of elements and pairs, and the solution with sparse factors. The equations are in
// haptic/sim/elasticity.hpp and dynamics/elastic_bodies.hpp.
//
// A batch holds one element per lane. Elements write their forces on each member to a place of their own, and a
// particle sums what its elements wrote in their order, so that neither the number of lanes nor that of threads changes
// a bit. Unused lanes, and members missing from an element of the batch, refer to a padding particle; each lane has its
// own.
#pragma once

#include <cstddef>
#include <cstdint>

#include "simd/projection.hpp"

namespace haptic::sim {

struct ElasticBatch {
    std::uint32_t first_slot;  // of its members
    std::uint32_t slots;       // members of the largest element
    bool damped;               // some element has a damping
};

/// Elements of one kind. Arrays of a triangle's values have two directions where those of a solid have three.
struct ElasticBatches {
    std::size_t batches;
    const ElasticBatch* batch;    // [batch]
    const std::uint32_t* centre;  // [batch][lane]
    const double* shear;          // [batch][lane], J: 2 mu V
    const double* lame;           // [batch][lane], J: lambda V
    const double* damping;        // [batch][lane], s
    const double* spread;         // [batch][xx, yy, zz, yx, zx, zy][lane]; null for triangles
    const std::uint32_t* member;  // [slot][lane]
    const double* gradient;       // [slot][x, y, z][lane], 1/m; of a triangle [slot][x, y][lane] in its own axes
    Row* force;                   // [slot][lane], N: out
};

/// Particles at x0, with padding.
struct ElasticParticles {
    const Row* position;  // m
    const Row* velocity;  // m/s
    Row* orientation;     // w, x, y, z: in as predicted, out the rotations of solid elements
};

/// Neighbours by pairs and forces by elements, of the particles in `particle`.
struct ForceSums {
    std::size_t count;
    const std::uint32_t* particle;     // [count]
    const std::uint32_t* first_force;  // per particle of the model, and one more: its range of `force`
    const std::uint32_t* force;        // places in the arrays of both kinds, solids first
    const Row* solid_force;
    const Row* triangle_force;
    std::uint32_t solid_places;       // places from here on are of triangles
    const std::uint32_t* first_pair;  // per particle of the model, and one more: its range of the following
    const std::uint32_t* other;       // the other particle
    const double* stiffness;          // N/m
    const double* viscosity;          // N s/m
    bool damped;                      // some viscosity is not 0
    const Row* position;
    const Row* velocity;
    const Row* given;  // N, per particle of the model: force to add
    Row* sum;          // N, [count]: out
};

/// Factors L D L^T, by columns of L below the diagonal.
struct FactorColumns {
    std::size_t rows;
    const std::uint32_t* first;  // [rows + 1]: range of the following
    const std::uint32_t* row;
    const double* below;
    const double* inverse_diagonal;  // [rows], 1 / D
    Row* side;                       // [rows]: in the right-hand side, out the solution
};

/// Elastic kernels for one number of lanes. All give the same bits.
struct ElasticKernels {
    std::size_t lanes;
    void (*solids)(const ElasticBatches& batches, const ElasticParticles& particles) noexcept;
    void (*triangles)(const ElasticBatches& batches, const ElasticParticles& particles) noexcept;
    void (*sum)(const ForceSums& sums) noexcept;
    void (*solve)(const FactorColumns& factor) noexcept;
};

}  // namespace haptic::sim
