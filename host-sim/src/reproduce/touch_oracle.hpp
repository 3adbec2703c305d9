// When a moving triangle first comes within a distance of a point, by brute force: what contact methods are judged by.
// Shares no code with them but the type of a vector.
#pragma once

#include <array>

#include "haptic/types.hpp"

namespace haptic::sim::reproduce {

using Corners = std::array<Vec3, 3>;

/// A triangle whose corners move linearly, t from 0 to 1.
struct LinearTriangle {
    Corners start{};
    Corners end{};
};

/// Distance from a point to a triangle: the least of those to the three edges, and of that to the plane where the foot
/// of the perpendicular is inside.
[[nodiscard]] double point_triangle_distance(const Vec3& p, const Corners& triangle);

/// Corners at a time.
[[nodiscard]] Corners corners_at_time(const LinearTriangle& triangle, double time);

enum class Verdict { Clear, Touches, Undecided };

struct OracleTouch {
    Verdict verdict = Verdict::Undecided;
    double time = 2.0;  // Touches: at this time the distance is within the radius, and before it none was found
};

/// Halves [0, 1] wherever the distance at the middle, less what the fastest corner can do in half of the interval, is
/// within the radius. Touches and Clear are proofs to rounding: one has a time at which the distance is within the
/// radius, the other has intervals without one that cover the step. What is nearer than `grazing` of the radius beyond
/// it is clear where the intervals become that short; Undecided after `kMostLooks` distances.
[[nodiscard]] OracleTouch first_time_within(const Vec3& p, double radius, const LinearTriangle& triangle);

inline constexpr double kGrazing = 1e-10;  // of the radius
inline constexpr int kMostLooks = 200'000;

}  // namespace haptic::sim::reproduce
