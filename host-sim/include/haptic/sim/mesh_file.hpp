// Mesh files: OBJ, PLY, STL (text and binary) and glTF 2 (.gltf and .glb), read with assimp.
//
// assimp 5.2, of Debian 12, is known to write beyond its buffers on malformed PLY and glTF files, and it has many
// importers. It therefore runs in a child process with limits on memory and time, and its result is checked like any
// untrusted input. This bounds the damage of a broken file. It is no defence against a malicious one, because the child
// has all rights of its user.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "haptic/sim/mesh.hpp"
#include "haptic/sim/mesh_check.hpp"
#include "haptic/sim/progress.hpp"

namespace haptic::sim {

enum class MeshFormat : std::uint8_t { Obj, Ply, Stl, Gltf, Glb };

struct MeshFileSettings {
    static constexpr double kMinScale = 1e-6;
    static constexpr double kMaxScale = 1e6;

    double scale = 1.0;                   // m per unit of the file, 1e-6 to 1e6; 0.001 for millimetres
    MeshCheckSettings check{};            // of the mesh that was read
    std::size_t max_bytes = 256U << 20U;  // of the file; also of all files together that a .gltf file refers to
    unsigned max_seconds = 30;            // 1 to 3600, CPU time of assimp

    /// Throws std::invalid_argument.
    void validate() const;
};

/// The format for a file's extension, in upper or lower case. Throws MeshError with the list of known extensions.
[[nodiscard]] MeshFormat mesh_format(const std::filesystem::path& file);

/// Reads, scales, welds and checks a mesh. Applies the transforms of scene nodes, splits polygons into triangles, and
/// ignores points and lines with a warning. Coordinates have 32-bit precision, from assimp. Buffers of a .gltf file
/// must be in its folder or below. Forks: call it before starting threads that hold locks. Throws MeshError (what is
/// wrong, where, and what would be right), and std::invalid_argument for settings out of range.
[[nodiscard]] CheckedMesh read_mesh(const std::filesystem::path& file, const MeshFileSettings& settings = {},
                                    const Progress& progress = {});

/// read_mesh() without the report.
[[nodiscard]] TriangleMesh load_mesh(const std::filesystem::path& file, const MeshFileSettings& settings = {});

/// read_mesh() from memory; `name` names the file in messages. A .gltf file must contain its buffers.
[[nodiscard]] CheckedMesh parse_mesh(std::span<const std::byte> bytes, MeshFormat format, const std::string& name,
                                     const MeshFileSettings& settings = {});

/// Writes a text .obj or .ply file whose coordinates read back as the same doubles. Writes a temporary file and renames
/// it. Throws MeshError for another extension or if writing fails.
void write_mesh(const std::filesystem::path& file, const TriangleMesh& mesh);

}  // namespace haptic::sim
