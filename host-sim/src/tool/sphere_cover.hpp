// Sphere cover: a small set of spheres that approximates a mesh for contact, with a proven bound of its error.
//
// The error has two parts. Uncovered depth: the greatest distance of a surface point from the nearest sphere.
// Protrusion: the greatest distance by which a sphere stands out of the mesh. Both bound every point of the surface,
// not only samples.
//
// Candidates are balls that touch a closed mesh from inside in two or more places, its medial axis, found by shrinking
// a ball that touches at a sample (Ma, Bae, Choi 2012). The error of a sample s is its distance |s - c| - d from the
// ball of radius d about c that covers it.
//   1. Greedy set cover: choose the candidate that covers most samples within an allowance; bisect the allowance until
//      the number fits.
//   2. Relaxation (Lloyd 1982, with the worst error in place of the mean square): move each ball to where the worst
//      error of its own samples is smallest.
//   3. Grow each ball by half of its worst error, so that uncovered depth equals protrusion.
// If a number of spheres is given, errors are divided by the square root of the ball's radius, so that thin parts such
// as fingers are met more closely than thick ones. An open mesh has no inside: its spheres are centred on it.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "haptic/sim/mesh.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

struct Ball {
    Vec3 centre{0.0};     // m
    double radius = 0.0;  // m
};

struct CoverSettings {
    std::size_t count = 0;  // number of spheres; 0: as many as `error` requires, up to max_count
    std::size_t max_count = 64;
    double radius = 0.0;  // m, the same for all; 0: each fits the mesh
    double error = 0.0;   // m, used if count is 0; for an open mesh with a radius it limits `uncovered` only
};

struct CoverError {
    double uncovered = 0.0;   // m
    double protrusion = 0.0;  // m; the greatest radius if the mesh is open
};

/// Depth of a point inside a closed mesh, m; negative outside.
[[nodiscard]] double depth_in(const TriangleMesh& mesh, const Vec3& p);

/// Upper bounds of a cover's error. `uncovered` exceeds the true value by at most 1 %, or 1e-4 of the mesh's size.
/// Throws std::invalid_argument for no balls.
[[nodiscard]] CoverError measure_cover(const TriangleMesh& mesh, std::span<const Ball> balls);

/// Covers a mesh with spheres, the same bits on every machine. Takes about 0.1 s for thousands of triangles. Throws
/// std::invalid_argument: a mesh without area; neither count nor error; more than max_count spheres needed, with the
/// error that max_count would leave.
[[nodiscard]] std::vector<Ball> cover_with_spheres(const TriangleMesh& mesh, const CoverSettings& settings);

}  // namespace haptic::sim
