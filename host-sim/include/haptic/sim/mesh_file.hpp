// Mesh files: OBJ, PLY, STL (text and binary) and glTF 2 (.gltf and .glb), read by assimp.
//
// assimp 5.2, which Debian 12 has, is known to write beyond its buffers on malformed PLY and glTF files, and its
// importers are many. So it runs in a child process of its own with limits of memory and time, and what it hands back
// is judged like anything else from outside. That bounds what a broken file can do; it is no defence against one that
// was made to attack, because the child has all rights of its user.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "haptic/sim/mesh.hpp"
#include "haptic/sim/mesh_check.hpp"

namespace haptic::sim {

enum class MeshFormat : std::uint8_t { Obj, Ply, Stl, Gltf, Glb };

struct MeshFileSettings {
    double scale = 1.0;                    // m per unit of the file, 1e-6 to 1e6; 0.001 for millimetres
    MeshCheckSettings check{};             // what is made of what was read
    std::size_t most_bytes = 256U << 20U;  // of the file, and of what a .gltf file refers to together
    unsigned most_seconds = 30;            // 1 to 3600, of computing, for assimp

    /// Throws std::invalid_argument.
    void validate() const;
};

/// The format that a file's extension stands for, in either case. Throws MeshError that lists the known ones.
[[nodiscard]] MeshFormat mesh_format(const std::filesystem::path& file);

/// Reads, scales, welds and checks a mesh. The places of a scene's nodes are applied, polygons are cut into triangles;
/// points and lines are left out, with a warning. Coordinates have the 32 bits that assimp gives them. Buffers that a
/// .gltf file names are read if they are in its folder or below. Forks: call it before threads are started that hold
/// locks. Throws MeshError: what is wrong, where, and what would be right; std::invalid_argument for settings.
[[nodiscard]] CheckedMesh read_mesh(const std::filesystem::path& file, const MeshFileSettings& settings = {});

/// The mesh of read_mesh alone.
[[nodiscard]] TriangleMesh load_mesh(const std::filesystem::path& file, const MeshFileSettings& settings = {});

/// The same from memory; `name` stands for the file in messages. A .gltf file must bring its buffers along.
[[nodiscard]] CheckedMesh parse_mesh(std::span<const std::byte> bytes, MeshFormat format, const std::string& name,
                                     const MeshFileSettings& settings = {});

/// Writes an .obj or .ply file (text; every coordinate in as many digits as it takes to read the same double again), to
/// a temporary file that is renamed into place. Throws MeshError for another extension or what cannot be written.
void write_mesh(const std::filesystem::path& file, const TriangleMesh& mesh);

}  // namespace haptic::sim
