// The constraints of a model in batches, and the functions that project them; solver.hpp has the equations.
//
// A batch holds as many constraints of one colour as there are lanes. Everything that is constant lies in the order in
// which it is read, a number for each lane; what moves is gathered from the particles and put back.
//
// Places are double, and constraints are projected in float. What two particles are apart when a sub-step begins is
// subtracted in double and then rounded; from there on only counts how far each has moved. So rounding is relative to
// the size of a group, not to where in the world it is, and no motion is so small that it is lost. Lanes that have no
// constraint, and members that a group of the batch does not have, refer to a particle of the lane's own that weighs
// nothing; these come after the last whole vector.
#pragma once

#include <cstddef>
#include <cstdint>

namespace haptic::sim {

/// Four numbers of a particle, so that one load brings in all of them.
struct alignas(32) Row {
    double number[4] = {};
};

struct alignas(16) FloatRow {
    float number[4] = {};
};

/// A particle while constraints are projected.
struct alignas(32) Body {
    FloatRow moved;                           // x, y, z in this sub-step, m; m r^2 / 5, kg m^2
    FloatRow turn{{1.0f, 0.0f, 0.0f, 0.0f}};  // w, x, y, z: unit, present_from_rest
};

/// Constraints name a particle by this times its index, from which it takes no shift to find its row.
inline constexpr std::size_t kNumbersOfRow = sizeof(Row) / sizeof(double);
inline constexpr std::size_t kNumbersOfBody = sizeof(Body) / sizeof(float);
static_assert(kNumbersOfBody == 2 * kNumbersOfRow);

/// What moves in the course of a step, per particle, filled up to whole vectors, and one more for each lane.
struct MovingParticles {
    Row* place;  // x, y, z, m r^2 / 5: m, kg m^2; constraints write what they move to `body`
    Body* body;
    float* scratch;  // [kMostBatchesInRun][most slots][kNumbersOfSlot][lane]
    Row* pushed;     // x, y, z: what contacts have moved it by in this sub-step, m; SolverContacts write it
};

/// Of shape [batch][lane], if no other is given.
struct LinkBatches {
    std::size_t count;
    const std::uint32_t* first;
    const std::uint32_t* second;
    const float* rest_length;  // m
    const float* first_share;  // stiffness * w1 / (w1 + w2), w inverse mass
    const float* second_share;
    float* start;  // [batch][x, y, z][lane], m, from first to second when the sub-step began
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
inline constexpr std::size_t kNumbersOfSlot = 7;  // of a member, from one stage to the next: offset, moved

inline constexpr std::size_t kMostLanes = 16;  // of any machine

struct GroupBatches {
    std::size_t runs;
    const GroupRun* run;     // [run]
    std::size_t most_slots;  // of any batch
    std::size_t batches;
    const GroupBatch* batch;  // [batch]
    // [batch][lane]
    const std::uint32_t* centre;
    const float* stiffness;              // compliant: stiffness / (1 + softness)
    const float* softness;               // compliance / h^2
    const float* inverse_mass;           // 1 / kg
    const std::int32_t* centre_is_free;  // 0: pinned
    // [slot][lane]
    const std::uint32_t* member;
    const float* weight;                 // part of the group's mass; 0: its group is smaller
    const float* rest_offset;            // [slot][x, y, z][lane], m, from the group's rest centroid
    float* start;                        // [slot][x, y, z][lane], m, from the centre when the sub-step began
    const std::int32_t* member_is_free;  // 0: pinned, or does not exist
    float* shift;                        // [slot][x, y, z][lane], m, by which compliant groups have moved it, so far
};

/// One of the ways to project, which all give the same bits. Counts of bodies are multiples of `lanes`.
struct Projection {
    std::size_t lanes;
    /// Turns each body by its rotation vector x, y, z. `turn` (w, x, y, z) is its turn before and after.
    void (*turn_bodies)(std::size_t count, const Row* turning, Row* turn, Body* body) noexcept;
    /// Writes the rates, rad/s, that took each body from its turn `before` to its present one within the step, s.
    /// `turn` is that of turn_bodies(), and becomes the present one: what constraints have turned a body by, added to
    /// it in double.
    void (*find_rates)(std::size_t count, const Row* before, const Body* body, double step, Row* turn,
                       Row* rate) noexcept;
    /// Writes the offsets of links and groups when a sub-step begins.
    void (*begin)(const LinkBatches& links, const GroupBatches& groups, const Row* place) noexcept;
    /// Rounds how far `count` places are from where they were when the sub-step began.
    void (*find_moved)(std::size_t count, const Row* place, const Row* start, Body* body) noexcept;
    /// Adds to the places what particles have been moved by since. Leaves alone all bits of what has not moved.
    void (*add_moved)(std::size_t count, const Body* body, const Row* start, Row* place) noexcept;
    void (*project_links)(const LinkBatches& links, bool forward, const MovingParticles& particles) noexcept;
    void (*project_springs)(const SpringBatches& springs, bool forward, const MovingParticles& particles) noexcept;
    void (*project_groups)(const GroupBatches& groups, bool forward, int rotation_iterations,
                           const MovingParticles& particles) noexcept;
};

// One lane serves as reference; four fit the baseline of x86-64 and aarch64.
extern const Projection kOneLane;
extern const Projection kFourLanes;
#if defined(__x86_64__)
extern const Projection kEightLanes;    // AVX2
extern const Projection kSixteenLanes;  // AVX-512F
#endif

}  // namespace haptic::sim
