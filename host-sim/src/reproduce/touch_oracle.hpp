// Contact oracle: by brute force, when a moving triangle first comes within a distance of a point. The reference for
// contact methods; it shares no code with them but the vector type.
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

/// Distance from a point to a triangle: the minimum over the three edges and, if the foot of the perpendicular is
/// inside, the plane.
[[nodiscard]] double point_triangle_distance(const Vec3& p, const Corners& triangle);

/// Corners at time t.
[[nodiscard]] Corners corners_at_time(const LinearTriangle& triangle, double time);

enum class Verdict { Clear, Touches, Undecided };

struct OracleTouch {
    Verdict verdict = Verdict::Undecided;
    double time = 2.0;  // Touches: the distance is within the radius at this time, and no earlier such time was found
};

/// Bisects [0, 1] wherever the distance at the middle, less the largest distance that a corner can travel in half of
/// the interval, is within the radius. Touches and Clear are proofs up to rounding: the former has a time at which the
/// distance is within the radius, the latter a cover of the step by intervals without one. Distances within kGrazing
/// radii beyond the radius count as clear once the intervals are short enough. Undecided after kMaxEvaluations
/// distances.
[[nodiscard]] OracleTouch first_time_within(const Vec3& p, double radius, const LinearTriangle& triangle);

inline constexpr double kGrazing = 1e-10;  // of the radius
inline constexpr int kMaxEvaluations = 200'000;

}  // namespace haptic::sim::reproduce
