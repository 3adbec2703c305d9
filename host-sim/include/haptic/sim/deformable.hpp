// Deformable body as built: surface, particles, the skin between them, and prescribed motions.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

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

struct DeformableBody {
    std::string name;
    TriangleMesh mesh;        // rest shape in the scene frame
    ParticleModel particles;  // one body, indices from 0
    Skin skin;                // one element per vertex of the mesh
    std::vector<Motion> motions;
};

/// Rigid placement of a body in the scene.
struct Placement {
    Vec3 position{0.0};                    // m, of the body's origin
    Quat orientation{1.0, 0.0, 0.0, 0.0};  // scene_from_body
    Vec3 velocity{0.0};                    // m/s, added to all free particles
};

/// Rotates and translates a body with its motions.
void place(DeformableBody& body, const Placement& placement);

}  // namespace haptic::sim
