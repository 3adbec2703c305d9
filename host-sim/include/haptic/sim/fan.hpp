// A fan of triangles, generated: the model on which the thesis tries out the pop-out (section 4.4.2).
#pragma once

#include <cstdint>

#include "haptic/sim/mesh.hpp"
#include "haptic/sim/particles.hpp"

namespace haptic::sim {

struct FanShape {
    std::uint32_t rim_vertices = 32;  // 3 to 4096; 32 gives the 33 vertices and 32 faces of the thesis
    double rim_radius = 4.0;          // m; the thesis does not give it. Its hands push the centre 1 to 3 m down
    double mass = 0.1;                // kg, of the whole fan, spread evenly over the vertices
    Vec3 centre{0.0, 0.0, 0.0};       // m, where the centre vertex rests

    /// Throws std::invalid_argument.
    void check() const;
};

/// A flat disc: vertex 0 in the centre, vertices 1 to rim_vertices evenly about it from +x over -z, and a triangle
/// between the centre and each two neighbours of the rim. Single-faced: the front looks along +y. Made with + - * / and
/// sqrt only, so that its bits are the same on every machine. Throws std::invalid_argument.
[[nodiscard]] TriangleMesh make_fan_mesh(const FanShape& shape);

/// One oriented particle for each vertex of make_fan_mesh, in the same order, each matched with its neighbours on the
/// fan: the one in the centre with all of the rim, each of the rim with the centre and the two beside it. Those of the
/// rim are pinned. There are no links: the thesis leaves out the cloth constraint here, so that the centre can be
/// pushed far.
[[nodiscard]] ParticleModel make_fan_particles(const FanShape& shape, double group_stiffness);

}  // namespace haptic::sim
