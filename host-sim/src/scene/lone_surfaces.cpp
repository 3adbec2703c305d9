#include "scene/lone_surfaces.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

#include "mesh/mesh_measures.hpp"
#include "mesh/mesh_topology.hpp"
#include "scene/assembly.hpp"

namespace haptic::sim {
namespace {

constexpr double kTestedAfter = 0.25;                  // s of lag
constexpr double kLeft = 0.9;                          // of the lag that much earlier: what is less catches up
constexpr int kTestsAlone = 3;                         // in a row, after which a body need not wait
constexpr std::uint64_t kMostTestsPerTriangle = 1000;  // of a search for crossings; more are too many

}  // namespace

LoneSurfaces::LoneSurfaces(const Assembly& assembly) : assembly_(assembly), surfaces_(assembly.bodies.size()) {
    const auto can_lag = [&](std::size_t b) { return assembly.is_movable(b) && !assembly.is_sheet(b); };
    for (std::size_t b = 0; b < surfaces_.size(); ++b) {
        // Copies follow one another.
        const TriangleMesh& mesh = assembly.bodies[b].mesh;
        if (b == 0 || mesh.triangles != assembly.bodies[b - 1].mesh.triangles || can_lag(b) != can_lag(b - 1)) {
            Shape& shape = shapes_.emplace_back(Shape{.volume = signed_volume(mesh)});
            if (can_lag(b) && detail::is_sphere(mesh.triangles, mesh.vertices.size())) {
                shape.crossings.emplace(std::array{CheckedSurface{mesh.triangles, 0}}, mesh.vertices);
            }
        }
        surfaces_[b].shape = shapes_.size() - 1;
    }
}

bool LoneSurfaces::end_step(std::size_t body, double lag, double step) noexcept {
    Surface& surface = surfaces_[body];
    if (!(lag > 0.0)) {
        surface.lagged = surface.lag = 0.0;
        surface.tests_alone = 0;
        return false;
    }
    surface.lagged += step;
    if (!shapes_[surface.shape].crossings || surface.lagged < kTestedAfter) {
        return false;
    }
    surface.lagged = 0.0;
    const double before = std::exchange(surface.lag, lag);
    return before > 0.0 && lag > kLeft * before;
}

bool LoneSurfaces::may_jump(std::size_t body, bool alone, std::span<const Vec3> skin) {
    surfaces_[body].tests_alone = alone ? surfaces_[body].tests_alone + 1 : 0;
    return alone && is_embedded(body, skin);
}

bool LoneSurfaces::need_not_wait(std::size_t body) const noexcept {
    return surfaces_[body].tests_alone >= kTestsAlone;
}

/// Whether the surface of a body would cross nothing of itself, and have its outside out, with these vertices of all.
bool LoneSurfaces::is_embedded(std::size_t body, std::span<const Vec3> vertices) {
    const SceneBody& of = assembly_.bodies[body];
    const std::span<const Vec3> own = vertices.subspan(of.first_vertex, of.mesh.vertices.size());
    auto& [volume, crossings] = shapes_[surfaces_[body].shape];
    if (!crossings || !(signed_volume(own, of.mesh.triangles) * volume > 0.0)) {
        return false;
    }
    const std::uint64_t tests = kMostTestsPerTriangle * of.mesh.triangles.size();
    return crossings->find(own, rounding_of(own), tests).empty() && crossings->complete();
}

}  // namespace haptic::sim
