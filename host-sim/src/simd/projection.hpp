// Constraint projection: the constraints of a model in batches, and the kernels that project them. The equations are in
// haptic/sim/solver.hpp.
//
// A batch holds one constraint per lane; no two of them share a particle. Constant data lies in the order in which it
// is read, one number per lane; particles are gathered into lanes and scattered back.
//
// Positions are double, projections are float. The offset between two particles at the start of a sub-step is computed
// in double and then rounded; after that only displacements within the sub-step count. Rounding is therefore relative
// to the size of a group, not to its position in the world, and no motion is too small to be kept. Unused lanes, and
// members missing from a group of the batch, refer to a padding particle without mass. Each lane has its own, after the
// last whole vector of particles.
#pragma once

#include <cstddef>
#include <cstdint>

namespace haptic::sim {

/// Four numbers of a particle, loaded at once.
struct alignas(32) Row {
    double number[4] = {};
};

struct alignas(16) FloatRow {
    float number[4] = {};
};

/// Single-precision state of a particle while constraints are projected.
struct alignas(32) ParticleF32 {
    FloatRow displacement;                           // x, y, z in this sub-step, m; m r^2 / 5, kg m^2
    FloatRow orientation{{1.0f, 0.0f, 0.0f, 0.0f}};  // w, x, y, z: unit, present_from_rest
};

/// Constraints name a particle by its index times this, so that its row is found without a shift.
inline constexpr std::size_t kDoublesPerRow = sizeof(Row) / sizeof(double);
inline constexpr std::size_t kFloatsPerParticle = sizeof(ParticleF32) / sizeof(float);
static_assert(kFloatsPerParticle == 2 * kDoublesPerRow);

/// Particles in the course of a step, filled up to whole vectors, plus one padding particle per lane.
struct MovingParticles {
    Row* position;     // x, y, z, m; m r^2 / 5, kg m^2. Constraints move `f32` instead
    ParticleF32* f32;  // per particle
    float* scratch;    // [kMaxBatchesInRun][max_slots][kFloatsPerSlot][lane]
    Row* pushed;       // x, y, z: displacement by contacts in this sub-step, m; added to by SolverContacts
};

/// Where forces lead particles in a sub-step: along straight paths, and turned. Arrays have shape [particle].
struct PredictedMotion {
    const double* velocity;  // m/s, x, y, z: not padded
    const ParticleF32* f32;  // with the orientations
};

/// Rigid distance constraints. Arrays have shape [batch][lane] unless noted.
struct LinkBatches {
    std::size_t count;
    const std::uint32_t* first;
    const std::uint32_t* second;
    const float* rest_length;  // m
    const float* first_share;  // stiffness * w1 / (w1 + w2), with w the inverse masses
    const float* second_share;
    float* start;  // [batch][x, y, z][lane], m, from first to second at the start of the sub-step
};

/// Links with a compliance. Arrays have shape [batch][lane].
struct SpringBatches {
    std::size_t count;
    const std::uint32_t* first;
    const std::uint32_t* second;
    const double* rest_length;         // m
    const double* first_inverse_mass;  // 1 / kg
    const double* second_inverse_mass;
    const double* scaled_compliance;  // 1 / kg, compliance / h^2
    const double* gain;               // kg, stiffness / (w1 + w2 + scaled_compliance)
    double* lambda;                   // kg m, the multiplier: tension * h^2 of this sub-step
};

struct GroupBatch {
    std::uint32_t first_slot;  // of its members
    std::uint32_t slots;       // members of the largest group
};

/// Batches of one round (constraint_batches.hpp) that pass through the phases of the projection together. Phases that
/// exchange their results in memory are 5 to 7 % faster than one long function, which moves more numbers between
/// registers and stack. The number of batches in a run, from 1 to 8, made no measurable difference on Zen 5.
struct GroupRun {
    std::uint32_t first_batch;
    std::uint32_t batches;  // 1..kMaxBatchesInRun
    bool uneven;            // some group is smaller than its batch, or a particle is pinned: the masks are needed
    bool compliant;         // all groups have a compliance; otherwise none has
};
inline constexpr std::size_t kMaxBatchesInRun = 4;
inline constexpr std::size_t kFloatsPerSlot = 7;  // passed from phase to phase: offset, displacement, m r^2 / 5

inline constexpr std::size_t kMaxLanes = 16;  // of any machine

/// Shape-matching groups.
struct GroupBatches {
    std::size_t runs;
    const GroupRun* run;    // [run]
    std::size_t max_slots;  // of any batch
    std::size_t batches;
    const GroupBatch* batch;  // [batch]
    // [batch][lane]
    const std::uint32_t* centre;
    const float* stiffness;              // compliant groups: stiffness / (1 + scaled_compliance)
    const float* scaled_compliance;      // compliance / h^2
    const float* inverse_mass;           // 1 / kg
    const std::int32_t* centre_is_free;  // 0: pinned
    // [slot][lane]
    const std::uint32_t* member;
    const float* weight;                 // fraction of the group's mass; 0: the group has fewer members
    const float* rest_offset;            // [slot][x, y, z][lane], m, from the group's rest centroid
    float* start;                        // [slot][x, y, z][lane], m, from the centre at the start of the sub-step
    const std::int32_t* member_is_free;  // 0: pinned, or no such member
    float* shift;                        // [slot][x, y, z][lane], m, displacement by compliant groups so far
};

/// Projection kernels for one number of lanes. All give the same bits. Particle counts are multiples of `lanes`, but
/// where the function says otherwise.
struct ProjectionKernels {
    std::size_t lanes;
    /// Rotates each particle by its rotation vector x, y, z, rad. `orientation` (w, x, y, z) is read and updated; `f32`
    /// receives it rounded. Any number of particles.
    void (*rotate_particles)(std::size_t count, const Row* rotation, Row* orientation, ParticleF32* f32) noexcept;
    /// Writes the angular velocity, rad/s, that leads from orientation `before` to the present one within `step`, s.
    /// `orientation` is the result of rotate_particles(); the rotation by constraints, if `f32` is not null, is added
    /// to it in double. Any number of particles.
    void (*find_angular_velocities)(std::size_t count, const Row* before, const ParticleF32* f32, double step,
                                    Row* orientation, Row* angular_velocity) noexcept;
    /// Writes the offsets of links and groups at the start of a sub-step.
    void (*begin_substep)(const LinkBatches& links, const GroupBatches& groups, const Row* position) noexcept;
    /// Rounds the displacement of each particle since the start of the sub-step to float.
    void (*round_displacements)(std::size_t count, const Row* position, const Row* start, ParticleF32* f32) noexcept;
    /// Adds to the positions how far particles have moved since round_displacements(). A particle that has not moved
    /// keeps all bits.
    void (*apply_displacements)(std::size_t count, const ParticleF32* f32, const Row* start, Row* position) noexcept;
    void (*project_links)(const LinkBatches& links, bool forward, const MovingParticles& particles) noexcept;
    void (*project_springs)(const SpringBatches& springs, bool forward, const MovingParticles& particles) noexcept;
    void (*project_groups)(const GroupBatches& groups, bool forward, int rotation_iterations,
                           const MovingParticles& particles) noexcept;
};

}  // namespace haptic::sim
