// Particle models as files: TOML that a person can read and change, one table for each particle.
//
// The file holds what moves a mesh, not the mesh, and no skinning weights: those follow from where the particles are
// and are made again when it is read, so that a particle can be moved, added or taken away.
#pragma once

#include <filesystem>
#include <string>

#include <haptic/config.hpp>
#include <haptic/sim/deformable.hpp>
#include <haptic/sim/mesh.hpp>

namespace haptic::sim {

/// The particles, groups, links and motions of a body, in the frame that its rest positions have. Every number has as
/// many digits as it takes to read the same double again.
[[nodiscard]] std::string model_toml(const DeformableBody& body);

/// Writes model_toml() to a file. Throws std::runtime_error that names it if it cannot be written.
void save_model(const std::filesystem::path& file, const DeformableBody& body);

/// The body that a mesh and the file's particles make; they are in the same frame. `bridge` is that of BuilderSettings.
/// What model_toml() wrote is read back to the same bits. Throws ConfigError, with file and line, for what is missing,
/// unknown, out of range, or names a particle that is none; std::invalid_argument for a mesh that build_skin refuses.
[[nodiscard]] DeformableBody read_model_file(const Config& config, const TriangleMesh& mesh, double bridge);

}  // namespace haptic::sim
