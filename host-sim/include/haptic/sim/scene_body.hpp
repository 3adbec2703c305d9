// Scene body: one body's rest mesh and its ranges in the common arrays of all bodies of a scene.
#pragma once

#include <cstddef>
#include <string>

#include "haptic/sim/mesh.hpp"

namespace haptic::sim {

struct SceneBody {
    std::string name;
    std::size_t first_vertex = 0;    // index of its first vertex among the vertices of all bodies
    std::size_t first_particle = 0;  // index of its first particle among the particles of all bodies
    TriangleMesh mesh;               // at rest; its triangles index its own vertices
};

}  // namespace haptic::sim
