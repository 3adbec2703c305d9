// What collisions know of each particle, as rows of numbers, and the functions that go through them in lanes.
//
// A row holds one number of each particle, and room for a whole vector behind them. All functions give the same bits
// with any number of lanes.
#pragma once

#include <cstddef>
#include <cstdint>

#include "simd/lanes.hpp"

namespace haptic::sim {

/// x, y and z, or what else belongs together, are rows that follow one another.
namespace collider_row {
// What does not change.
inline constexpr std::size_t kSemiAxes = 0;          // m
inline constexpr std::size_t kAxes = kSemiAxes + 3;  // w, x, y, z: rest_from_ellipsoid
inline constexpr std::size_t kSize = kAxes + 4;      // m, mean semi-axis
inline constexpr std::size_t kReach = kSize + 1;     // m, largest semi-axis
// Of the sub-step.
inline constexpr std::size_t kFrom = kReach + 1;         // m
inline constexpr std::size_t kTo = kFrom + 3;            // m
inline constexpr std::size_t kTurn = kTo + 3;            // w, x, y, z: present_from_rest, where something is near
inline constexpr std::size_t kSlack = kTurn + 4;         // m, of low and high, in case constraints lead it further
inline constexpr std::size_t kLow = kSlack + 1;          // m, around the way: of a ball, then of the ellipsoid
inline constexpr std::size_t kHigh = kLow + 3;           // m
inline constexpr std::size_t kShape = kHigh + 3;         // m^2, as EllipsoidShape
inline constexpr std::size_t kGroundLeast = kShape + 6;  // m, height that the ground keeps
inline constexpr std::size_t kCount = kGroundLeast + 1;
}  // namespace collider_row

struct ColliderRows {
    double* number;
    std::size_t length;  // of a row
    [[nodiscard]] HAPTIC_LANES double* operator[](std::size_t row) const noexcept { return number + row * length; }
};

/// An array of structures by the place of one number in the first of them.
struct Strided {
    const double* first;
    std::size_t stride;  // in numbers
};

/// How far the ways of particles are taken to go.
struct WaySlack {
    double of_size;  // part of the mean semi-axis
    double of_way;   // part of the greatest side of its box
};

// m: no coordinate is as large.
inline constexpr double kBeyondAll = 1e300;

struct Bounds {
    double low[3];
    double high[3];
};

struct Ground {
    double height;    // m
    double push_out;  // m, by which what begins in it may be moved out
};

/// Bits of what is near a particle.
inline constexpr std::int64_t kNearBody = 1;
inline constexpr std::int64_t kNearGround = 2;

/// Planes to be laid between particles; arrays of shape [pair], with a whole vector behind.
struct PlaneRows {
    const std::uint32_t* first;
    const std::uint32_t* second;
    double* normal[3];  // out: toward the first
    double* least;      // out, m: that the first has to be ahead of the second along it
    double* clearance;  // out, m: that is left beyond it wherever each stops on its way, and in spite of their slack
};

/// Contacts between particles and the ground, which do not touch one another's particles; arrays of shape [contact].
struct GroundContacts {
    std::size_t count;
    const std::uint32_t* particle;
    const double* least;     // m, height that the ground keeps
    const double* start[2];  // m, x and z at the start
    double* push;            // m, upward in this sub-step, at least 0
    double* rub[2];          // m, in x and z, by friction; 0 where nothing has pushed
};

struct FrictionOf {
    double still;  // static and dynamic coefficient
    double moving;
};

/// Boxes on a lattice (swept_pairs.hpp): rows of lows and highs in x, y and z, and of bodies, and 32 bytes behind them.
struct LatticeRows {
    const std::int16_t* row[7];
};

/// One of the ways to do it.
struct ColliderKernels {
    std::size_t lanes;
    /// From the rows that do not change, kFrom to kHigh, around balls.
    void (*find_ways)(const ColliderRows& rows, std::size_t count, Strided from, Strided to, WaySlack slack) noexcept;
    /// Around the boxes of particles [begin, end).
    Bounds (*bounds)(const ColliderRows& rows, std::size_t begin, std::size_t end) noexcept;
    /// Adds `bit` to `near`, per particle, of those of [begin, end) whose boxes overlap these.
    void (*mark)(const ColliderRows& rows, std::size_t begin, std::size_t end, const Bounds& bounds, std::int64_t bit,
                 std::int64_t* near) noexcept;
    /// Shapes, boxes around ellipsoids and kGroundLeast, of all in vectors in which some `near` is not 0.
    void (*find_shapes)(const ColliderRows& rows, std::size_t count, const std::int64_t* near, Ground ground) noexcept;
    void (*lay_planes)(const ColliderRows& rows, std::size_t count, const PlaneRows& planes, double push_out) noexcept;
    /// Writes which boxes of [box + 1, end) overlap this one and are of other bodies, in order; tells how many.
    std::size_t (*compare_boxes)(const LatticeRows& boxes, std::size_t box, std::size_t end,
                                 std::uint32_t* overlapping) noexcept;
    /// Moves the places (x, y and z of each four numbers) of what is below, or has been pushed too far.
    void (*press_ground)(const GroundContacts& contacts, FrictionOf friction, double* place) noexcept;
};

// One lane serves as reference; two fit the baseline of x86-64 and aarch64.
extern const ColliderKernels kColliderOneLane;
extern const ColliderKernels kColliderTwoLanes;
#if defined(__x86_64__)
extern const ColliderKernels kColliderFourLanes;   // AVX2
extern const ColliderKernels kColliderEightLanes;  // AVX-512F
#endif

/// Those with so many lanes, or the most that the machine has for ParticleCollisions::kWidest. Throws
/// std::invalid_argument for lanes that it does not have.
[[nodiscard]] const ColliderKernels& collider_kernels(std::size_t lanes);

}  // namespace haptic::sim
