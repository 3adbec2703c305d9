// Fuzz target: meshes from arbitrary bytes as a file of each format, and from numbers as triangles. The result is a
// MeshError that starts with the name, or a mesh that satisfies mesh_check.hpp. assimp runs in a child process and may
// crash there; this does not count as a finding.
//
// The first byte selects the interpretation of the others.
#include <pthread.h>
#include <sanitizer/common_interface_defs.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <map>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "haptic/sim/mesh_file.hpp"
#include "require.hpp"

namespace {

using haptic::Vec3;
using haptic::sim::CheckedMesh;
using haptic::sim::MeshFormat;
using haptic::sim::Triangle;
using haptic::sim::TriangleMesh;

/// Whether each edge is traversed equally often in both directions.
bool is_balanced(const TriangleMesh& mesh) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, int> surplus;
    for (const Triangle& t : mesh.triangles) {
        for (std::size_t i = 0; i < 3; ++i) {
            const std::uint32_t from = t[i];
            const std::uint32_t to = t[(i + 1) % 3];
            surplus[std::minmax(from, to)] += from < to ? 1 : -1;
        }
    }
    return std::all_of(surplus.begin(), surplus.end(), [](const auto& edge) { return edge.second == 0; });
}

void check(const CheckedMesh& checked) {
    const auto& [mesh, report] = checked;
    require(report.vertices == mesh.vertices.size() && report.triangles == mesh.triangles.size() &&
                report.vertices_given == report.vertices + report.welded + report.unused &&
                report.triangles_given == report.triangles + report.collapsed + report.duplicates,
            "the report counts right");
    require(!mesh.triangles.empty() && report.area > 0.0 && std::isfinite(report.area), "there is a surface");
    std::vector<bool> used(mesh.vertices.size(), false);
    for (const Triangle& t : mesh.triangles) {
        for (const std::uint32_t i : t) {
            require(i < mesh.vertices.size(), "indices are there");
            used[i] = true;
        }
        require(t[0] != t[1] && t[1] != t[2] && t[2] != t[0], "no triangle has a corner twice");
    }
    require(std::find(used.begin(), used.end(), false) == used.end(), "every vertex carries a triangle");
    for (const Vec3& v : mesh.vertices) {
        require(std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z), "coordinates are numbers");
    }
    require(!mesh.closed || (is_balanced(mesh) && report.volume > 0.0), "closed is closed");
    const CheckedMesh again = haptic::sim::check_mesh(mesh.vertices, mesh.triangles, {.weld_tolerance = 0.0}, "again");
    require(again.mesh.vertices == mesh.vertices && again.mesh.triangles == mesh.triangles &&
                again.mesh.closed == mesh.closed,
            "what was mended needs no mending");
}

void read_file(std::span<const std::byte> bytes, MeshFormat format) {
    haptic::sim::MeshFileSettings settings;
    settings.max_seconds = 1;
    settings.check.max_vertices = 100'000;
    settings.check.max_triangles = 100'000;
    try {
        check(haptic::sim::parse_mesh(bytes, format, "fuzz", settings));
    } catch (const haptic::sim::MeshError& error) {
        require(std::string_view(error.what()).starts_with("fuzz: "), "an error names the mesh");
    }
}

/// Mostly small numbers, so that positions and corners often coincide; sometimes any number.
void read_soup(std::span<const std::byte> bytes) {
    std::vector<Vec3> vertices;
    std::vector<Triangle> triangles;
    const auto byte = [&bytes](std::size_t i) { return std::to_integer<unsigned>(bytes[i]); };
    const std::size_t count = bytes.empty() ? 0 : byte(0) % 64;
    std::size_t at = 1;
    for (; vertices.size() < count && at + 3 <= bytes.size(); at += 3) {
        vertices.emplace_back(byte(at), byte(at + 1), byte(at + 2) / 8);
        if (byte(at) == 255 && at + 11 <= bytes.size()) {
            std::memcpy(&vertices.back().y, &bytes[at + 3], sizeof(double));
            at += sizeof(double);
        }
    }
    for (; at + 3 <= bytes.size(); at += 3) {
        const auto index = [&](std::size_t i) {
            return static_cast<std::uint32_t>(byte(i) == 255 ? 255 : byte(i) % std::max<std::size_t>(count, 1));
        };
        triangles.push_back({index(at), index(at + 1), index(at + 2)});
    }
    try {
        check(haptic::sim::check_mesh(vertices, triangles, {}, "fuzz"));
    } catch (const haptic::sim::MeshError& error) {
        require(std::string_view(error.what()).starts_with("fuzz: "), "an error names the mesh");
    }
}

}  // namespace

// Limits a single allocation of the child. Its memory limit has no effect here.
extern "C" const char* __asan_default_options() {
    return "max_allocation_size_mb=256:handle_segv=0:handle_abort=0:handle_sigfpe=0";
}

extern "C" int LLVMFuzzerInitialize(int* /*argc*/, char*** /*argv*/) {
    // A crash of the child is no finding: suppress the fuzzer's report and artifact.
    return pthread_atfork(nullptr, nullptr, [] {
        __sanitizer_set_death_callback(nullptr);
        (void)::chdir("/proc");
        (void)::close(STDERR_FILENO);
    });
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size == 0) {
        return 0;
    }
    const std::vector<std::byte> copy(reinterpret_cast<const std::byte*>(data) + 1,
                                      reinterpret_cast<const std::byte*>(data) + size);
    constexpr std::array kFormats{MeshFormat::Obj, MeshFormat::Ply, MeshFormat::Stl, MeshFormat::Gltf, MeshFormat::Glb};
    if (data[0] % 8 < kFormats.size()) {
        read_file(copy, kFormats[data[0] % 8]);
    } else {
        read_soup(copy);
    }
    return 0;
}
