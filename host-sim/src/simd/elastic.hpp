// Elastic kernels: the forces of elements and pairs, and the solution with sparse factors. The equations are in
// haptic/sim/elasticity.hpp and dynamics/elastic_bodies.hpp.
//
// A batch holds one element per lane. An element writes what it pulls at each of its members to a place of its own, and
// a particle sums what pulls at it in the elements' order, so that neither the number of lanes nor that of threads
// changes a bit. Unused lanes, and members missing from an element of the batch, refer to a padding particle; each lane
// has its own.
#pragma once

#include <cstddef>
#include <cstdint>

#include "simd/lanes.hpp"
#include "simd/projection.hpp"

namespace haptic::sim {

struct ElasticBatch {
    std::uint32_t first_slot;  // of its members
    std::uint32_t slots;       // members of the largest element
};

/// Elements of one kind. Arrays of a triangle's values have two directions where those of a solid have three.
struct ElasticBatches {
    std::size_t batches;
    const ElasticBatch* batch;    // [batch]
    const std::uint32_t* centre;  // [batch][lane]; the first member too
    const double* shear;          // [batch][lane], J: 2 mu V
    const double* lame;           // [batch][lane], J: lambda V
    const double* bound;          // [batch][lane], J: kappa V, to add kappa V F b to the pulls; null: not to
    const double* damping;        // [batch][lane], s
    double own_damping;           // s, of the step itself: the elements add what they have more
    bool damped;                  // some element has more
    const double* spread;         // [batch][xx, yy, zz, yx, zx, zy][lane]; null for triangles
    const std::uint32_t* member;  // [slot][lane]
    const double* gradient;       // [slot][x, y, z][lane], 1/m; of a triangle [slot][x, y][lane] in its own axes
    Row* pull;                    // [slot][lane], N: out, at the member
};

/// Particles at x0, with padding.
struct ElasticParticles {
    const Row* position;  // m
    const Row* velocity;  // m/s
    Row* orientation;     // w, x, y, z: in as predicted, out the rotations of solid elements
};

/// What elements and pairs pull at the particles in `particle`.
struct ForceSums {
    std::size_t count;
    const std::uint32_t* particle;     // [count]
    const std::uint32_t* first_share;  // per particle of the model, and one more: its range of the following
    const std::uint32_t* share;        // place in `pull`
    const Row* pull;                   // N, of the elements
    const std::uint32_t* first_pair;   // as first_share, of the following; null: without pairs
    const std::uint32_t* other;        // the other particle
    const double* stiffness;           // N/m
    const double* damping;             // s
    double own_damping;                // s, see ElasticBatches
    bool damped;
    const Row* position;
    const Row* velocity;
    const Row* given;  // N, per particle of the model: force to add
    Row* sum;          // N, [count]: out
};

/// Up to kPanelColumns consecutive columns of L with one pattern.
struct FactorPanel {
    std::uint32_t column;     // its first
    std::uint32_t width;      // columns
    std::uint32_t first_row;  // range of FactorPanels::row: those of its columns, then the rows below
    std::uint32_t rows;
    std::uint32_t first;  // of FactorPanels::below, [row][column of the panel]
};

inline constexpr std::size_t kPanelColumns = 4;

/// Factors L D L^T.
struct FactorPanels {
    std::size_t panels;
    const FactorPanel* panel;
    const std::uint32_t* row;
    const double* below;             // elements of L below the diagonal; 0 elsewhere
    const double* inverse_diagonal;  // per row, 1 / D
    // In the right-hand side, out the solution: a row of it, or x, y and z of two sides and two unused numbers.
    Row* side;
};

/// Coordinates of Q and r, for which a particle moves when its body turns.
inline constexpr std::size_t kLevers = 6;

/// Particles of a body that move with pushes; see dynamics/elastic_pushes.hpp.
struct PushedRows {
    std::size_t count;
    std::size_t pushes;
    const double* const* column;  // [pushes][count], m/N
    const Row* force;             // [pushes], N
    const double* lever;          // [kLevers][lever_length], first those of the body; null: none
    std::size_t lever_length;
    const Row* terms;  // [kLevers]: what the levers are multiplied with
    Row* position;     // [count], m: in and out
};

// Numbers of the widest register: rows over places have room for a whole one.
inline constexpr std::size_t kPlacePadding = 8;

/// What the pushes of a body have turned, alpha and gamma those since it moved, and its places; see
/// dynamics/elastic_pushes.hpp.
struct alignas(64) PushedBody {
    Row alpha;               // rad/s^2
    Row gamma;               // rad
    Row turned_by_pushes;    // rad, of the whole body, by all of the sub-step
    Row by_torque[3];        // rad/(N m): how far each coordinate of a torque turns it; 0: it does not turn freely
    double h_squared = 0.0;  // s^2, of the sub-step
    std::size_t places = 0;  // rounded up to kPlacePadding
    double* moved[3] = {};   // [places], m: by columns of W
    bool pushed = false;
};

/// A particle that takes part: how it moves with its body, and what a force on it does.
struct alignas(64) PushedPlace {
    Row by_alpha[3];                   // s^2 m: how far it moves by each coordinate of the body's alpha
    Row by_gamma[3];                   // m, of gamma
    Row alpha[3];                      // rad/(s^2 N), by each coordinate of a force on it
    Row gamma[3];                      // rad/N
    const double* response = nullptr;  // [places], m/N: W of it and the others
    Row* force = nullptr;              // N, since the body moved
    PushedBody* body = nullptr;
    std::size_t index = 0;  // in `moved`
};

/// A contact keeps a particle at normal . (x1 - x2) >= min_separation from another one or the ground. Its force acts
/// at the ends of its arms, and x1 and x2 are where the particles would be if they had moved as these.
struct alignas(64) PushedContact {
    Row normal;                   // unit, toward the first
    Row from;                     // m, x1 - x2 where friction begins, less what has turned the arms before pushes
    Row friction;                 // N, on the first: in and out
    double from_along = 0.0;      // m, of that along the normal
    double min_separation = 0.0;  // m
    double along = 0.0;           // N/m, stiffness of both together
    double across = 0.0;          // N/m
    double push = 0.0;            // m, along the normal, at least 0: in and out
    std::int32_t partner = 0;     // places to the contact that is solved with this one, negative at that; 0: none
    float coupling = 0.0F;        // m/N: how far a force of one of the two opens the other
    struct Side {
        PushedPlace* place = nullptr;  // null: the particle moves alone
        Row* position = nullptr;       // m, where its body moved last; null: the ground
        double alone = 0.0;            // m/N, of a particle that moves alone
        LaneVec<double> arm{};         // m, from the particle to where the force acts; 0: its body does not turn
    } first, second;
};

/// One pass over contacts, in the order 0, stride, 2 stride, ... modulo their number, or backward.
struct ContactPass {
    std::size_t count;
    PushedContact* contact;
    std::size_t stride;  // without a common divisor with count
    bool forward;
    double relaxation;  // each goes so much further than to where it alone would be met
    double sticking;    // coefficients of friction
    double sliding;
};

/// Elastic kernels for one number of lanes. All give the same bits.
struct ElasticKernels {
    std::size_t lanes;
    void (*solids)(const ElasticBatches& batches, const ElasticParticles& particles) noexcept;
    void (*triangles)(const ElasticBatches& batches, const ElasticParticles& particles) noexcept;
    void (*sum)(const ForceSums& sums) noexcept;
    void (*solve_side)(const FactorPanels& factor) noexcept;
    void (*solve_two_sides)(const FactorPanels& factor) noexcept;
    void (*move)(const PushedRows& rows) noexcept;
    void (*push)(const PushedContact::Side& side, const Row& force) noexcept;
    /// Returns the largest change of a push, m.
    double (*pass)(const ContactPass& pass) noexcept;
};

}  // namespace haptic::sim
