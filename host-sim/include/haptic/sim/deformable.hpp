// Deformable body as built: surface, particles, the skin between them, prescribed motions and loads.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "haptic/sim/elasticity.hpp"
#include "haptic/sim/mesh.hpp"
#include "haptic/sim/particles.hpp"
#include "haptic/sim/skin.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// Prescribed motion: particles with a common displacement from their rest positions as a function of time.
struct Motion {
    std::vector<std::uint32_t> particles;  // of the body; all pinned
    std::vector<double> times;             // s, increasing, the first 0
    std::vector<Vec3> offsets;             // m, one per time; linear between them
    bool repeat = false;                   // periodic with the last time as period; else hold the last offset
};

/// Displacement, m, at a time since the start, s.
[[nodiscard]] Vec3 offset_at(const Motion& motion, double time_s) noexcept;

/// Surface under pressure. Each of its vertices is a weighted sum of particles' positions, y_j = sum over i of w_ji
/// x_i, and a vertex passes its force to the particles by the same weights. The force is thus the gradient of pressure
/// times volume: it does the work of the pressure, and takes the moment of the surface as well as its force.
struct PressedSurface {
    std::vector<std::vector<ParticleWeight>> vertices;
    std::vector<Triangle> triangles;  // of these vertices
    // Scratch, one per vertex.
    std::vector<Vec3> position{};  // m
    std::vector<Vec3> force{};     // N
};

/// Load: a force that keeps its direction in the scene, a pressure on the surface that turns with it, or both.
///
/// The force is divided among its particles by mass, as gravity is. A pressed triangle of area A takes the force
/// pressure * A against its outward normal, both of the present surface, a third at each corner.
struct Load {
    Vec3 force{0.0};                       // N, scene frame, total
    std::vector<ParticleWeight> shares{};  // of the free particles in the force
    double pressure = 0.0;                 // Pa
    PressedSurface surface{};              // empty without a pressure
    std::vector<double> times{};           // s, increasing, the first 0; empty: constant
    std::vector<double> factors{};         // of force and pressure, one per time; linear between them
    bool repeat = false;                   // periodic with the last time as period; else hold the last factor
};

/// Factor of the load at a time since the start, s.
[[nodiscard]] double factor_at(const Load& load, double time_s) noexcept;

/// Adds the load's forces, N, to those of the body's particles, which are at `position`, m. No allocation.
void add_forces(Load& load, double time_s, std::span<const Vec3> position, std::span<Vec3> force) noexcept;

struct DeformableBody {
    std::string name;
    TriangleMesh mesh;        // rest shape in the scene frame
    ParticleModel particles;  // one body, indices from 0
    Skin skin;                // one element per vertex of the mesh
    std::vector<Motion> motions;
    std::vector<Load> loads{};
};

/// Rigid placement of a body in the scene.
struct Placement {
    Vec3 position{0.0};                    // m, of the body's origin
    Quat orientation{1.0, 0.0, 0.0, 0.0};  // scene_from_body
    Vec3 velocity{0.0};                    // m/s, added to all free particles
};

/// Rotates and translates a body with its motions. Forces of loads keep their direction in the scene.
void place(DeformableBody& body, const Placement& placement);

}  // namespace haptic::sim
