// Spheres that stand for a mesh in contact: few of them, and a bound on what they miss.
//
// A cover errs by what it leaves bare, the greatest distance of a point of the surface from the nearest sphere, and by
// how far a sphere stands proud of what the mesh encloses. Both are bounds that hold for every point of the surface,
// not for samples of it.
//
// Candidates are balls that touch a closed mesh from inside in two places or more (its medial axis; found by shrinking
// a ball that touches at a sample, Ma, Bae, Choi 2012). A ball of radius d about c misses a sample s by |s - c| - d.
// Balls are chosen greedily, the one first that takes in most samples within an allowance, which is halved until the
// number fits; then each moves to where it misses least of what it takes in, over and over (Lloyd 1982, with the
// greatest miss in place of the mean square). In the end each ball grows by half of what it misses, so bare and proud
// are alike. Where a number of spheres is given, a miss counts the more the smaller the ball is that has it, by the
// root of its radius, so that thin parts, fingers, are met more closely than thick ones. An open mesh has no inside:
// its spheres sit on it.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <haptic/sim/mesh.hpp>
#include <haptic/types.hpp>

namespace haptic::sim {

struct Ball {
    Vec3 centre{0.0};     // m
    double radius = 0.0;  // m
};

struct CoverSettings {
    std::size_t count = 0;  // of spheres; 0: as many as `error` asks for, most_count at most
    std::size_t most_count = 64;
    double radius = 0.0;  // m, of each; 0: each has its own
    double error = 0.0;   // m, if count is 0. An open mesh with a radius: of what is bare only
};

struct CoverError {
    double bare = 0.0;   // m
    double proud = 0.0;  // m; of an open mesh the greatest radius
};

/// m, from a point to the surface of a closed mesh; negative outside.
[[nodiscard]] double depth_in(const TriangleMesh& mesh, const Vec3& p);

/// What a cover misses: upper bounds, `bare` at most 1 % above what it is, or 1e-4 of the mesh's size. Of at least one
/// ball.
[[nodiscard]] CoverError measure_cover(const TriangleMesh& mesh, std::span<const Ball> balls);

/// Spheres for a mesh, the same on every machine. Some 0.1 s for thousands of triangles. Throws std::invalid_argument:
/// a mesh without area, nothing that says how many, more spheres than most_count, and the error that those would leave.
[[nodiscard]] std::vector<Ball> cover_with_spheres(const TriangleMesh& mesh, const CoverSettings& settings);

}  // namespace haptic::sim
