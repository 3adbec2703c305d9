// Fan generator: a disc of triangles, on which the thesis tests pop-out (section 4.4.2).
#pragma once

#include <cstdint>

#include "haptic/sim/mesh.hpp"
#include "haptic/sim/particles.hpp"

namespace haptic::sim {

struct FanShape {
    std::uint32_t rim_vertices = 32;  // 3 to 4096; 32 gives the 33 vertices and 32 faces of the thesis
    double rim_radius = 4.0;          // m; not given in the thesis, whose hands push the centre 1 to 3 m down
    double mass = 0.1;                // kg, of the whole fan, the same for each vertex
    Vec3 centre{0.0, 0.0, 0.0};       // m, rest position of the centre vertex

    /// Throws std::invalid_argument.
    void check() const;
};

/// A flat disc: vertex 0 is the centre, vertices 1 to rim_vertices are evenly spaced about it from +x towards -z, and
/// each two neighbours of the rim form a triangle with the centre. Single-faced: the front looks along +y. Uses + - * /
/// and sqrt only, so its bits are the same on every machine. Throws std::invalid_argument.
[[nodiscard]] TriangleMesh make_fan_mesh(const FanShape& shape);

/// One oriented particle per vertex of make_fan_mesh, in the same order. The group of the centre has all rim particles,
/// that of a rim particle the centre and its two neighbours. Rim particles are pinned. There are no links: the thesis
/// omits the cloth constraint here, so that the centre can be pushed far.
[[nodiscard]] ParticleModel make_fan_particles(const FanShape& shape, double group_stiffness);

}  // namespace haptic::sim
