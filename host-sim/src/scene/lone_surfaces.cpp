#include "scene/lone_surfaces.hpp"

#include <algorithm>
#include <array>
#include <cstdint>

#include "mesh/mesh_measures.hpp"
#include "mesh/mesh_topology.hpp"
#include "scene/assembly.hpp"

namespace haptic::sim {
namespace {

constexpr double kTestedAfter = 0.25;  // s of lag
constexpr int kAloneInTests = 3;       // in a row, after which a body need not wait

}  // namespace

bool is_sphere(const TriangleMesh& mesh) {
    const std::size_t vertices = mesh.vertices.size();
    const std::vector<std::uint8_t> all(mesh.triangles.size(), 1);
    const std::vector<detail::Side> sides = detail::sorted_sides(mesh.triangles, all);
    std::size_t edges = 0;
    bool closed = true;
    detail::for_each_edge(sides, [&](std::span<const detail::Side> of_edge) {
        ++edges;
        closed = closed && of_edge.size() == 2 && of_edge[0].forward != of_edge[1].forward;
    });
    // Euler's characteristic.
    return closed && vertices + mesh.triangles.size() == edges + 2 &&
           detail::count_parts(mesh.triangles, vertices) == 1 &&
           detail::count_fans(mesh.triangles, all, sides, vertices).pinched == 0;
}

LoneSurfaces::LoneSurfaces(const Assembly& assembly) : assembly_(assembly) {
    for (const SceneBody& body : assembly.bodies) {
        surfaces_.push_back({.may_be_led = is_sphere(body.mesh), .volume = signed_volume(body.mesh)});
    }
}

bool LoneSurfaces::is_due(std::size_t body, double lag, double step) noexcept {
    Surface& surface = surfaces_[body];
    if (!(lag > 0.0)) {
        surface.lagged = 0.0;
        surface.alone = 0;
        return false;
    }
    surface.lagged += step;
    if (!surface.may_be_led || surface.lagged < kTestedAfter) {
        return false;
    }
    surface.lagged = 0.0;
    return true;
}

bool LoneSurfaces::may_jump(std::size_t body, bool alone, std::span<const Vec3> skin) {
    surfaces_[body].alone = alone ? surfaces_[body].alone + 1 : 0;
    return alone && is_embedded(body, skin);
}

bool LoneSurfaces::need_not_wait(std::size_t body) const noexcept {
    return surfaces_[body].alone >= kAloneInTests;
}

/// Whether the surface of a body would cross nothing of itself, and have its outside out, with these vertices of all.
bool LoneSurfaces::is_embedded(std::size_t body, std::span<const Vec3> vertices) {
    const SceneBody& of = assembly_.bodies[body];
    const std::span<const Vec3> own = vertices.subspan(of.first_vertex, of.mesh.vertices.size());
    Surface& surface = surfaces_[body];
    if (!surface.crossings) {
        surface.crossings.emplace(std::array{CheckedSurface{of.mesh.triangles, 0}}, of.mesh.vertices);
    }
    return surface.crossings->find(own, rounding_of(own)).empty() &&
           signed_volume(own, of.mesh.triangles) * surface.volume > 0.0;
}

}  // namespace haptic::sim
