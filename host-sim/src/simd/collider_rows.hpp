// Collider kernels: per-particle data of particle collisions as rows of numbers, and the loops over them.
//
// A row holds one number of each particle, followed by room for a whole vector. All kernels give the same bits with any
// number of lanes.
#pragma once

#include <cstddef>
#include <cstdint>

#include "simd/lanes.hpp"

namespace haptic::sim {

/// Row numbers. Vectors, quaternions and matrices take consecutive rows.
namespace collider_row {
// Constant.
inline constexpr std::size_t kSemiAxes = 0;          // m
inline constexpr std::size_t kAxes = kSemiAxes + 3;  // w, x, y, z: rest_from_ellipsoid
inline constexpr std::size_t kSize = kAxes + 4;      // m, mean semi-axis
inline constexpr std::size_t kReach = kSize + 1;     // m, largest semi-axis
inline constexpr std::size_t kStretch = kReach + 1;  // m, what that is longer than the smallest one
// Of the sub-step: the path of a particle is the segment from x to the predicted position u.
inline constexpr std::size_t kFrom = kStretch + 1;        // m, x
inline constexpr std::size_t kTo = kFrom + 3;             // m, u
inline constexpr std::size_t kOrientation = kTo + 3;      // w, x, y, z: present_from_rest; only near other things
inline constexpr std::size_t kSlack = kOrientation + 4;   // m, margin of the box for displacement by constraints
inline constexpr std::size_t kLow = kSlack + 1;           // m, box about the path: of a ball, then of the ellipsoid
inline constexpr std::size_t kHigh = kLow + 3;            // m
inline constexpr std::size_t kShape = kHigh + 3;          // m^2, as EllipsoidShape
inline constexpr std::size_t kGroundHeight = kShape + 6;  // m, lowest height that the ground permits
// Bounds of how far any plane that touches the particle has moved along its normal, from one sub-step to the next: only
// differences mean something.
inline constexpr std::size_t kLastOrientation = kGroundHeight + 1;  // the one before, near other things
inline constexpr std::size_t kTravel = kLastOrientation + 4;        // m, to the start of the sub-step
inline constexpr std::size_t kTravelToEnd = kTravel + 1;            // m, to wherever it may stop, with the slack
inline constexpr std::size_t kCount = kTravelToEnd + 1;
}  // namespace collider_row

struct ColliderRows {
    double* number;
    std::size_t length;  // of a row
    [[nodiscard]] HAPTIC_LANES double* operator[](std::size_t row) const noexcept { return number + row * length; }
};

/// Straight paths of particles in a sub-step. Arrays have shape [particle][x, y, z].
struct Paths {
    const double* start;     // m
    const double* velocity;  // m/s
    double step;             // s
};

/// Margin of a box about a path: these fractions of two lengths.
struct PathSlack {
    double of_size;  // of the particle's mean semi-axis
    double of_path;  // of the longest side of the path's box
};

// m: larger than any coordinate.
inline constexpr double kUnbounded = 1e300;

struct Bounds {
    double low[3];
    double high[3];
};

/// How far what overlaps at the start of a sub-step comes apart in it: by a share of the overlap, and no farther than
/// the most.
struct PushOut {
    double most = 0.0;   // m
    double share = 0.0;  // of the overlap

    /// m, the least gap that is permitted at the end, where `gap`, m, is that at the start; negative: an overlap.
    template <class Real>
    [[nodiscard]] HAPTIC_LANES Real least_gap(const Real& gap) const noexcept {
        const Real by_most = gap + most;
        const Real by_share = (1.0 - share) * gap;
        const Real least = by_most < by_share ? by_most : by_share;
        return least < Real{} ? least : Real{};
    }
};

struct Ground {
    double height = 0.0;  // m
    PushOut push_out;
};

/// Bits: what may touch a particle in this sub-step.
inline constexpr std::int64_t kNearBody = 1;
inline constexpr std::int64_t kNearGround = 2;

/// Separating planes between pairs of particles. Arrays have shape [pair], with room for a whole vector behind.
struct PlaneRows {
    const std::uint32_t* first;
    const std::uint32_t* second;
    double* normal[3];     // out: unit, toward the first
    double* min_distance;  // out, m: smallest permitted distance of the first ahead of the second along the normal
    double* clearance;     // out, m: distance beyond it wherever each stops on its path, less their slack
};

/// Contacts of different particles with the ground. Arrays have shape [contact].
struct GroundContacts {
    std::size_t count;
    const std::uint32_t* particle;
    const double* min_height;  // m, lowest permitted height
    const double* start[2];    // m, x and z at the start of the sub-step
    double* push;              // m, upward displacement in this sub-step, at least 0
    double* friction[2];       // m, displacement by friction in x and z; 0 without push
};

struct FrictionCoefficients {
    double sticking;
    double sliding;
};

/// Rounded boxes in rows of low x, y, z, then high, m, with room for a whole vector behind.
struct BoxRows {
    const float* number;
    std::size_t length;  // of a row
    [[nodiscard]] HAPTIC_LANES const float* operator[](std::size_t row) const noexcept { return number + row * length; }
};
struct RoundedBox {
    float number[6];  // m, low x, y, z, then high
};

/// Collider kernels for one number of lanes.
struct ColliderKernels {
    std::size_t lanes;
    /// Writes kFrom, kTo, kSlack, kLow and kHigh: boxes about the paths of balls; and kTravel and kTravelToEnd of
    /// those.
    void (*find_path_boxes)(const ColliderRows& rows, std::size_t count, const Paths& paths, PathSlack slack) noexcept;
    /// The bounds of the boxes of particles [begin, end).
    Bounds (*bounds)(const ColliderRows& rows, std::size_t begin, std::size_t end) noexcept;
    /// Sets `bit` in `near`, per particle, of those in [begin, end) whose boxes overlap `bounds`.
    void (*mark)(const ColliderRows& rows, std::size_t begin, std::size_t end, const Bounds& bounds, std::int64_t bit,
                 std::int64_t* near) noexcept;
    /// Writes kShape, the boxes about the ellipsoids' paths and kGroundHeight of all vectors with a `near` that is not
    /// 0, and adds to kTravel and kTravelToEnd what their rotation does.
    void (*find_ellipsoid_boxes)(const ColliderRows& rows, std::size_t count, const std::int64_t* near,
                                 Ground ground) noexcept;
    void (*find_planes)(const ColliderRows& rows, std::size_t count, const PlaneRows& planes,
                        PushOut push_out) noexcept;
    /// Writes, in order, which boxes of [begin, end) overlap this one; returns their number. Writes up to a whole
    /// vector beyond them. Boxes with numbers that are none do not overlap.
    std::size_t (*find_overlaps)(const BoxRows& boxes, const RoundedBox& box, std::size_t begin, std::size_t end,
                                 std::uint32_t* overlapping) noexcept;
    /// One projection of all ground contacts with friction. `position` has rows of x, y, z and another number, m.
    void (*project_ground)(const GroundContacts& contacts, FrictionCoefficients friction, double* position) noexcept;
};

/// The kernels with this number of lanes; the widest of this machine for ParticleCollisions::kWidest. Throws
/// std::invalid_argument for a number that the machine does not have.
[[nodiscard]] const ColliderKernels& collider_kernels(std::size_t lanes);

}  // namespace haptic::sim
