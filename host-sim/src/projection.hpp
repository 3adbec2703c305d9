// The constraints of a model in batches, and the functions that project them; solver.hpp has the equations.
//
// A batch holds as many constraints of one colour as there are lanes. Everything that is constant lies in the order in
// which it is read, a number for each lane; what moves is gathered from the particles and put back. Lanes that have no
// constraint, and members that a group of the batch does not have, refer to one more particle, which stays as it is and
// comes after the last whole vector.
#pragma once

#include <cstddef>
#include <cstdint>

namespace haptic::sim {

/// Four numbers of a particle, so that one load brings in all of them.
struct alignas(32) Row {
    double number[4] = {};
};

/// How a particle is turned.
struct Body {
    Row spin[3];                     // columns of m r^2 / 5 R, kg m^2; the last number is unused
    Row turn{{1.0, 0.0, 0.0, 0.0}};  // w, x, y, z: unit, present_from_rest
};
inline constexpr std::size_t kRowsOfBody = sizeof(Body) / sizeof(Row);

/// What moves in the course of a step, per particle, filled up to whole vectors, and one more.
struct MovingParticles {
    Row* place;  // x, y, z, mass: m, kg
    Body* body;
    Row* scratch;  // [kMostBatchesInRun][most slots][lane]
    Row* pushed;   // x, y, z: what contacts have moved it by in this sub-step, m; SolverContacts write it
};

/// Arrays of shape [batch][lane].
struct LinkBatches {
    std::size_t count;
    const std::uint32_t* first;
    const std::uint32_t* second;
    const double* rest_length;  // m
    const double* first_share;  // stiffness * w1 / (w1 + w2), w inverse mass
    const double* second_share;
};

/// Links with a compliance. Arrays of shape [batch][lane].
struct SpringBatches {
    std::size_t count;
    const std::uint32_t* first;
    const std::uint32_t* second;
    const double* rest_length;         // m
    const double* first_inverse_mass;  // 1 / kg
    const double* second_inverse_mass;
    const double* softness;  // 1 / kg, compliance / h^2
    const double* gain;      // kg, stiffness / (w1 + w2 + softness)
    double* pull;            // kg m, tension * h^2 of this sub-step
};

struct GroupBatch {
    std::uint32_t first_slot;  // of its members
    std::uint32_t slots;       // members of the largest group
};

/// Batches of one colour that are taken through the stages of the projection together. Stages that hand on their
/// results in memory are 5 to 7 % faster than one long function, which moves more numbers between registers and stack.
/// How many batches a run has made no difference that could be measured on Zen 5, from 1 to 8.
struct GroupRun {
    std::uint32_t first_batch;
    std::uint32_t batches;  // 1..kMostBatchesInRun
    bool uneven;            // some group is smaller than its batch, or something is pinned: the masks are needed
    bool compliant;         // all groups have a compliance; else none has
};
inline constexpr std::size_t kMostBatchesInRun = 4;

struct GroupBatches {
    std::size_t runs;
    const GroupRun* run;      // [run]
    std::size_t most_slots;   // of any batch
    const GroupBatch* batch;  // [batch]
    // [batch][lane]
    const std::uint32_t* centre;
    const double* stiffness;             // compliant: stiffness / (1 + softness)
    const double* softness;              // compliance / h^2
    const double* inverse_mass;          // 1 / kg
    const double* centre_spin_mass;      // kg m^2, m r^2 / 5
    const std::int64_t* centre_is_free;  // 0: pinned
    // [slot][lane]
    const std::uint32_t* member;
    const double* rest_offset;           // [slot][x, y, z][lane], m, from the group's rest centroid
    const std::int64_t* member_exists;   // 0: its group is smaller
    const std::int64_t* member_is_free;  // 0: pinned, or does not exist
    double* shift;                       // [slot][x, y, z][lane], m, by which compliant groups have moved it, so far
};

/// One of the ways to project, which all give the same bits. Counts of bodies are multiples of `lanes`.
struct Projection {
    std::size_t lanes;
    /// Turns each body by its rotation vector x, y, z, and makes its spin that of m r^2 / 5, the fourth number.
    void (*turn_bodies)(std::size_t count, const Row* turning, Body* body) noexcept;
    /// Writes the rates, rad/s, that took each body from its turn `before` to its present one within the step, s.
    void (*find_rates)(std::size_t count, const Row* before, const Body* body, double step, Row* rate) noexcept;
    void (*project_links)(const LinkBatches& links, bool forward, const MovingParticles& particles) noexcept;
    void (*project_springs)(const SpringBatches& springs, bool forward, const MovingParticles& particles) noexcept;
    void (*project_groups)(const GroupBatches& groups, bool forward, int rotation_iterations,
                           const MovingParticles& particles) noexcept;
};

// One lane serves as reference; two fit the baseline of x86-64 and aarch64.
extern const Projection kOneLane;
extern const Projection kTwoLanes;
#if defined(__x86_64__)
extern const Projection kFourLanes;   // AVX2
extern const Projection kEightLanes;  // AVX-512F
#endif

}  // namespace haptic::sim
