// Particle model files: TOML for reading and editing, one table per particle.
//
// The file has the particles, not the mesh, and no skinning weights. These follow from the particles' positions and are
// made when the file is read, so that particles can be moved, added or removed.
#pragma once

#include <filesystem>
#include <string>

#include "haptic/config.hpp"
#include "haptic/sim/deformable.hpp"
#include "haptic/sim/mesh.hpp"
#include "haptic/sim/progress.hpp"

namespace haptic::sim {

/// Particles, groups, links and motions of a body, in the frame of its rest positions. Every number reads back as the
/// same double.
[[nodiscard]] std::string model_toml(const DeformableBody& body);

/// Writes model_toml() to a file. Throws std::runtime_error with the file's name if that fails.
void save_model(const std::filesystem::path& file, const DeformableBody& body);

/// Makes a body from a mesh and the file's particles, in the same frame. `bridge` is as in BuilderSettings. Reads the
/// output of model_toml() back to the same bits. Throws ConfigError, with file and line, for keys that are missing,
/// unknown or out of range and for particles that do not exist; std::invalid_argument for a mesh that build_skin()
/// refuses. `progress`: of build_skin().
[[nodiscard]] DeformableBody read_model_file(const Config& config, const TriangleMesh& mesh, double bridge,
                                             const Progress& progress = {});

}  // namespace haptic::sim
