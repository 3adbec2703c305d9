// A deformable body as it is built: its surface, the particles that move it, the skin between the two, and what drives
// it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "haptic/sim/mesh.hpp"
#include "haptic/sim/particles.hpp"
#include "haptic/sim/skin.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

/// Particles that are led along a way instead of by forces: at each moment they are displaced by the same vector from
/// where they were at rest.
struct Motion {
    std::vector<std::uint32_t> particles;  // of the body; all pinned
    std::vector<double> times;             // s, increasing, the first 0
    std::vector<Vec3> offsets;             // m, one for each time; piecewise linear between
    bool repeat = false;                   // after the last time begin again; else stay
};

/// The displacement at a time since the start, s.
[[nodiscard]] Vec3 offset_at(const Motion& motion, double time_s) noexcept;

struct DeformableBody {
    std::string name;
    TriangleMesh mesh;        // rest shape, in its place in the scene
    ParticleModel particles;  // one body; numbered from 0
    Skin skin;                // one element a vertex of the mesh
    std::vector<Motion> motions;
};

/// Where a body is put. Rest shapes turn and move as a whole; masses and stiffnesses stay.
struct Placement {
    Vec3 position{0.0};                    // m, of the body's origin
    Quat orientation{1.0, 0.0, 0.0, 0.0};  // scene_from_body
    Vec3 velocity{0.0};                    // m/s, of all particles that are not pinned
};

/// Turns and moves a body, its motions with it.
void place(DeformableBody& body, const Placement& placement);

}  // namespace haptic::sim
