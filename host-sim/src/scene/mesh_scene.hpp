// Mesh scene: a scene made for any mesh, so that its user can touch it at once.
//
// The body has the same size in the scene whatever the unit of the mesh, because few files name their unit and the
// device has one reach. Everything that depends on size is then constant: the sphere that touches, the step, the
// stiffness of the coupling. How the body comes to rest, where a sphere stays on top of it and how hard it pushes back
// cannot be told from the mesh alone, so they are tried out in a simulation of the scene.
#pragma once

#include <string>

#include "haptic/sim/mesh_check.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/sim/simulation.hpp"

namespace haptic::sim {

struct MeshScene {
    Scene scene;              // as `text` reads, with the mesh in memory
    std::string text;         // commented scene file
    std::string explanation;  // what was found and chosen, lines of plain text
};

/// Makes a scene in which a scripted hand presses the mesh, given in the unit of its file. `file` is the name that the
/// scene file uses for the mesh; `clock` times the steps of the trial. Simulates 3.5 s. The same mesh gives the same
/// text on every machine. Throws MeshError for a mesh too far from its origin, std::invalid_argument for one without
/// particles, and std::runtime_error for one that does not stay finite or cannot be touched.
[[nodiscard]] MeshScene make_mesh_scene(const CheckedMesh& mesh, const std::string& file,
                                        Simulation::ClockFunction clock, const Progress& progress = {});

}  // namespace haptic::sim
