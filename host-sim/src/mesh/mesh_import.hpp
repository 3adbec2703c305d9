// assimp, and the child process that it is kept in.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include <haptic/sim/mesh.hpp>
#include <haptic/sim/mesh_file.hpp>

namespace haptic::sim::detail {

/// Triangles as a file has them.
struct ImportedMesh {
    std::vector<Vec3> vertices;  // in the file's unit
    std::vector<Triangle> triangles;
    std::vector<std::string> warnings;
};

struct ImportRequest {
    std::span<const std::byte> bytes;
    MeshFormat format = MeshFormat::Obj;
    std::filesystem::path folder;  // of what a .gltf file refers to; empty: it refers to nothing
    std::size_t most_bytes = 0;    // of all that it refers to together
    std::size_t most_vertices = 0;
    std::size_t most_triangles = 0;
};

/// Reads a mesh with assimp, in this process. Throws std::runtime_error: what assimp or a limit says.
[[nodiscard]] ImportedMesh import_mesh(const ImportRequest& request);

/// What a child process may have.
struct ChildLimits {
    std::size_t memory_bytes = std::size_t{4} << 30U;  // of addresses; not under sanitizers, which reserve terabytes
    unsigned cpu_s = 30;
};

/// Runs `work` in a forked child and returns what it returned. What happens to the child's memory stays there; what
/// comes back is within the limits of the request and otherwise as untrusted as the file. Throws std::runtime_error:
/// what the child threw, or how it died.
[[nodiscard]] ImportedMesh in_child(const std::function<ImportedMesh()>& work, const ImportRequest& request,
                                    const ChildLimits& limits);

}  // namespace haptic::sim::detail
