// Oriented particles for any mesh, without a hand at work: where they sit, which belong together, and the skin.
//
// The body is cut into small pieces joined by ways that stay inside it, or on it if it has no inside. All distances
// here are taken along these ways, so two fins, or the walls of a slit, are not held together through the air.
//
//   1. Particles: the piece farthest from those chosen before, over and over; then each moves to the centroid of what
//      is nearest to it until they are evenly spread (Gonzalez 1985; Lloyd 1982).
//   2. A particle's mass is its share of the body's volume (of its area, if it is open), and its ellipsoid has the
//      second moments of that share.
//   3. A group is a particle with the nearest others; where that would leave the body in parts, the nearest particles
//      of two parts join each other's groups.
//   4. A vertex is carried by up to four particles with weights (1 - d / d5)^2, normalised, d5 being the distance of
//      the fifth: a particle enters and leaves with weight 0, so the weights have no steps.
//
// The idea of particles with ellipsoids, spread over a mesh and matched in groups, is that of M. Müller and N.
// Chentanez, "Solid Simulation with Oriented Particles", 2011; there, links come from a hand or from the mesh's edges.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "haptic/sim/deformable.hpp"
#include "haptic/sim/mesh.hpp"

namespace haptic::sim {

struct BuilderSettings {
    static constexpr std::size_t kMostParticles = 20'000;
    static constexpr std::size_t kMostNeighbours = 32;

    std::size_t particles = 137;   // 0 to kMostParticles; 0: one for each vertex, where it is
    std::size_t neighbours = 8;    // 1 to kMostNeighbours, that make a group with each particle
    double mass = 0.3;             // kg, of the whole body
    double group_stiffness = 0.6;  // 0..1, of shape matching
    double link_stiffness = 0.0;   // 0..1, of a distance constraint to each neighbour; 0: there are none
    double bridge = 0.0;           // m, over which parts of the mesh are held together; 0: the particles' spacing
};

/// Builds the particles and the skin of a mesh of either kind; they are the same, bit for bit, on every machine.
/// Throws std::invalid_argument: a setting out of its range, an index or a vertex that is none, a vertex that no
/// triangle has, a mesh without area, parts farther from one another than `bridge`.
[[nodiscard]] DeformableBody build_body(const TriangleMesh& mesh, const BuilderSettings& settings);

/// A body whose particles are in given places, and which of them have parts of the body in common: by pairs, the lower
/// one first.
struct PlacedBody {
    DeformableBody body;
    std::vector<std::pair<std::uint32_t, std::uint32_t>> neighbours;
};

/// Builds particles where somebody wants them, and the skin. All is as in build_body, but for settings.particles, which
/// does not count, and the places, which need not be in the mesh. Throws std::invalid_argument as build_body does, and
/// without a place.
[[nodiscard]] PlacedBody build_body_at(const TriangleMesh& mesh, std::span<const Vec3> places,
                                       const BuilderSettings& settings);

/// The skin for particles that somebody moved or removed: weights as build_body makes them, for particles wherever
/// they are. Vertices are those of `mesh`.
/// Throws std::invalid_argument as build_body does.
[[nodiscard]] Skin build_skin(const TriangleMesh& mesh, const ParticleModel& particles, double bridge);

}  // namespace haptic::sim
