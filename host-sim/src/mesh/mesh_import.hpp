// Mesh import: assimp, and the child process in which it runs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "haptic/sim/mesh.hpp"
#include "haptic/sim/mesh_file.hpp"

namespace haptic::sim::detail {

/// Triangles as they are in the file.
struct ImportedMesh {
    std::vector<Vec3> vertices;  // in the file's unit
    std::vector<Triangle> triangles;
    std::vector<std::string> warnings;
};

struct ImportRequest {
    std::span<const std::byte> bytes;
    MeshFormat format = MeshFormat::Obj;
    std::filesystem::path folder;  // for the files that a .gltf file refers to; empty: none are allowed
    std::size_t max_bytes = 0;     // of all these files together
    std::size_t max_vertices = 0;
    std::size_t max_triangles = 0;
};

/// Reads a mesh with assimp, in this process. Throws std::runtime_error with the message of assimp or of a limit.
[[nodiscard]] ImportedMesh import_mesh(const ImportRequest& request);

/// Resource limits of the child process.
struct ChildLimits {
    std::size_t memory_bytes = std::size_t{4} << 30U;  // of address space; not with sanitizers, which reserve terabytes
    unsigned cpu_s = 30;
};

/// Runs `work` in a forked child and returns its result. Memory errors stay in the child; the result is within the
/// limits of the request and otherwise as untrusted as the file. Throws std::runtime_error: the child's exception, or
/// how it died.
[[nodiscard]] ImportedMesh in_child(const std::function<ImportedMesh()>& work, const ImportRequest& request,
                                    const ChildLimits& limits);

}  // namespace haptic::sim::detail
