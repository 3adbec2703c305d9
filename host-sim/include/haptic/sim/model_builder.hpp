// Model builder: distributes oriented particles over any mesh, groups them and makes the skin.
//
// The body is divided into small samples, joined by edges that stay inside the body, or on its surface if it has no
// inside. All distances are measured along these edges, so that two fins, or the walls of a slit, are not joined
// through the air.
//
//   1. Particles: farthest-point sampling (T. F. Gonzalez, 1985), then each particle moves to the centroid of the
//      samples nearest to it until they are evenly spread (S. P. Lloyd, 1982).
//   2. A particle's mass is its share of the body's volume (area, if the mesh is open); its ellipsoid has the second
//      moments of that share.
//   3. A group is a particle with its nearest others. Where that leaves the body disconnected, the nearest particles
//      of two parts join each other's groups.
//   4. Up to four particles move a vertex, with weights (1 - d / d5)^2, normalised, where d5 is the distance of the
//      fifth. A particle enters and leaves with weight 0, so the weights are continuous.
//
// @source M. Müller, N. Chentanez, "Solid Simulation with Oriented Particles", 2011, for ellipsoidal particles on a
// mesh in groups. There, links are made by hand or from the mesh's edges.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "haptic/sim/deformable.hpp"
#include "haptic/sim/mesh.hpp"
#include "haptic/sim/progress.hpp"

namespace haptic::sim {

struct BuilderSettings {
    static constexpr std::size_t kMaxParticles = 20'000;
    static constexpr std::size_t kMaxNeighbours = 32;

    std::size_t particles = 137;   // 0 to kMaxParticles; 0: one at each vertex
    std::size_t neighbours = 8;    // 1 to kMaxNeighbours, other particles in a group
    double mass = 0.3;             // kg, of the whole body
    double group_stiffness = 0.6;  // 0..1, of shape matching
    double link_stiffness = 0.0;   // 0..1, of a distance constraint to each neighbour; 0: none
    double bridge = 0.0;  // m, largest gap across which parts of the mesh are joined; 0: the particles' spacing
};

/// Builds particles and skin of a closed or open mesh, with the same bits on every machine. Throws
/// std::invalid_argument for settings out of range, bad indices, vertices that are not finite or unused, a mesh without
/// area, and parts farther apart than `bridge`.
[[nodiscard]] DeformableBody build_body(const TriangleMesh& mesh, const BuilderSettings& settings,
                                        const Progress& progress = {});

/// A body with particles at given positions, and the pairs of particles whose cells of the body touch, lower index
/// first.
struct PlacedBody {
    DeformableBody body;
    std::vector<std::pair<std::uint32_t, std::uint32_t>> neighbours;
};

/// Like build_body(), with particles at `positions`, which need not be inside the mesh. Ignores settings.particles.
/// Throws std::invalid_argument as build_body() does, and for an empty span.
[[nodiscard]] PlacedBody build_body_at(const TriangleMesh& mesh, std::span<const Vec3> positions,
                                       const BuilderSettings& settings, const Progress& progress = {});

/// The skin of `mesh` for given particles, with weights as in build_body(). For models whose particles were edited.
/// Throws std::invalid_argument as build_body() does.
[[nodiscard]] Skin build_skin(const TriangleMesh& mesh, const ParticleModel& particles, double bridge,
                              const Progress& progress = {});

}  // namespace haptic::sim
