#include "scene/scene_collisions.hpp"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "collision/body_sweep.hpp"
#include "contact/swept_tree.hpp"
#include "scene/assembly.hpp"
#include "simd/aabb.hpp"
#include "simd/collider_rows.hpp"

namespace haptic::sim {
namespace {

// Of a search for crossings at the start: usual ones need less than a tenth.
constexpr std::size_t kTestsPerTriangle = 500;

/// Calls visit(vertex) for those of the edge and of the triangle, among all vertices.
template <class Visit>
void for_each_vertex(const Assembly& assembly, const SurfaceCrossing& crossing, const Visit& visit) {
    const SceneBody& of_edge = assembly.bodies[crossing.edge_object];
    const SceneBody& of_triangle = assembly.bodies[crossing.object];
    for (const std::uint32_t v : crossing.edge) {
        visit(of_edge.first_vertex + v);
    }
    for (const std::uint32_t v : of_triangle.mesh.triangles[crossing.triangle]) {
        visit(of_triangle.first_vertex + v);
    }
}

/// Per vertex: at rest it belongs to an edge or triangle of a sheet that crosses another one.
std::vector<std::uint8_t> crossing_vertices(const Assembly& assembly, std::span<const std::uint8_t> sheet) {
    std::vector<std::uint8_t> crosses(assembly.mesh.vertices.size(), 0);
    if (std::ranges::find(sheet, 1) == sheet.end()) {
        return crosses;
    }
    SurfaceCrossings at_rest = make_surface_crossings(assembly);
    for (const SurfaceCrossing& crossing : at_rest.find(assembly.mesh.vertices, rounding_of(assembly.mesh.vertices))) {
        if (sheet[crossing.edge_object] == 0 || sheet[crossing.object] == 0) {
            continue;
        }
        for_each_vertex(assembly, crossing, [&](std::size_t v) { crosses[v] = 1; });
    }
    return crosses;
}

/// What crosses of the surfaces of solids at the start; of a search that finds no end, all that might.
SurfacesAtStart crossing_solids(const Assembly& assembly, std::span<const SolidSurface> solids,
                                std::span<const Vec3> start) {
    // Only what meets itself, or lies in the box of another one that it meets, is worth the search.
    std::vector<Bounds> bounds;
    bounds.reserve(assembly.bodies.size());
    for (std::size_t b = 0; b < assembly.bodies.size(); ++b) {
        bounds.push_back(bounds_of(aabb_of(assembly.surface_of(b, start))));
    }
    std::vector<BodyPair> near;
    BodySweep(bounds.size()).find(bounds, near);
    std::erase_if(near, [&](const BodyPair& p) {
        const SolidSurface& one = solids[p.first];
        const SolidSurface& other = solids[p.second];
        return !one.meets_others || !other.meets_others || !(one.movable || other.movable);
    });
    std::vector<CheckedSurface> surfaces(solids.size());  // of the others, nothing
    std::size_t triangles = 0;
    const auto check = [&](std::size_t b) {
        triangles += surfaces[b].triangles.empty() ? solids[b].triangles.size() : 0;
        surfaces[b] = {solids[b].triangles, solids[b].first_vertex};
    };
    for (const BodyPair& pair : near) {
        check(pair.first);
        check(pair.second);
    }
    for (std::size_t b = 0; b < solids.size(); ++b) {
        if (solids[b].meets_itself) {
            check(b);
        }
    }
    SurfacesAtStart left_alone;
    if (triangles == 0) {
        return left_alone;
    }
    SurfaceCrossings at_start(surfaces, start);
    const auto found = at_start.find(start, rounding_of(start), kTestsPerTriangle * triangles);
    if (!at_start.complete()) {
        left_alone.crossing = near;
        for (std::uint32_t v = 0; v < start.size(); ++v) {
            left_alone.vertices.push_back(v);
        }
        return left_alone;
    }
    for (const SurfaceCrossing& c : found) {
        if (c.edge_object == c.object) {
            for_each_vertex(assembly, c,
                            [&](std::size_t v) { left_alone.vertices.push_back(static_cast<std::uint32_t>(v)); });
            continue;
        }
        const auto [low, high] = std::minmax({c.edge_object, c.object});
        const bool known =
            std::ranges::any_of(left_alone.crossing, [&](auto p) { return p.first == low && p.second == high; });
        if (!known) {
            left_alone.crossing.push_back({low, high});
        }
    }
    return left_alone;
}

}  // namespace

std::unique_ptr<ParticleCollisions> make_collisions(const ParticleModel& model, const CollisionSettings& settings,
                                                    std::span<const std::uint8_t> sheet,
                                                    ParticleCollisions::ClockFunction clock) {
    const bool alone = model.bodies.size() < 2 || !settings.between_bodies;
    if (alone && !settings.ground) {
        return nullptr;
    }
    std::vector<ParticleRange> sheets;
    for (std::size_t b = 0; b < sheet.size(); ++b) {
        if (sheet[b] != 0) {
            sheets.push_back(model.bodies[b]);
        }
    }
    return std::make_unique<ParticleCollisions>(model, settings, clock, ParticleCollisions::kWidest, sheets);
}

SurfaceCrossings make_surface_crossings(const Assembly& assembly) {
    std::vector<CheckedSurface> surfaces;
    surfaces.reserve(assembly.bodies.size());
    for (const SceneBody& body : assembly.bodies) {
        surfaces.push_back({body.mesh.triangles, body.first_vertex});
    }
    return {surfaces, assembly.mesh.vertices};
}

std::vector<std::uint8_t> colliding_sheets(const Assembly& assembly, const CollisionSettings& settings) {
    std::vector<std::uint8_t> collides;
    collides.reserve(assembly.bodies.size());
    for (std::size_t b = 0; b < assembly.bodies.size(); ++b) {
        collides.push_back(settings.surfaces && assembly.is_sheet(b) ? 1 : 0);
    }
    return collides;
}

std::unique_ptr<SurfaceContacts> make_surface_contacts(const Assembly& assembly, const CollisionSettings& settings,
                                                       std::span<const std::uint8_t> sheet,
                                                       ParticleCollisions::ClockFunction clock) {
    const std::vector<std::uint8_t> crosses = crossing_vertices(assembly, sheet);
    std::vector<ParticleSurface> sheets;
    for (std::size_t b = 0; b < assembly.bodies.size(); ++b) {
        if (sheet[b] != 0) {
            const SceneBody& body = assembly.bodies[b];
            sheets.push_back({.first_particle = static_cast<std::uint32_t>(body.first_particle),
                              .triangles = body.mesh.triangles,
                              .rest = body.mesh.vertices,
                              .left_alone = std::span(crosses).subspan(body.first_vertex, body.mesh.vertices.size())});
        }
    }
    return sheets.empty() ? nullptr : std::make_unique<SurfaceContacts>(assembly.model, sheets, settings, clock);
}

std::unique_ptr<SolidSurfaces> make_solid_surfaces(Assembly& assembly, const CollisionSettings& settings,
                                                   std::span<const Vec3> start) {
    std::vector<SolidSurface> surfaces;
    bool some_follow = false;
    for (std::size_t b = 0; b < assembly.bodies.size(); ++b) {
        some_follow = some_follow || (assembly.is_movable(b) && !assembly.is_sheet(b));
    }
    for (std::size_t b = 0; b < assembly.bodies.size(); ++b) {
        const SceneBody& body = assembly.bodies[b];
        surfaces.push_back({.tree = &assembly.trees[b],
                            .triangles = body.mesh.triangles,
                            .first_vertex = body.first_vertex,
                            .vertices = body.mesh.vertices.size(),
                            .meets_others = settings.surfaces && settings.between_bodies && some_follow,
                            .meets_itself = settings.surfaces && assembly.is_movable(b) && !assembly.is_sheet(b),
                            .movable = assembly.is_movable(b) && !assembly.is_sheet(b),
                            .exact = assembly.is_sheet(b),
                            .floor = assembly.floor[b]});
    }
    SurfacesAtStart left_alone = crossing_solids(assembly, surfaces, start);
    return std::make_unique<SolidSurfaces>(std::move(surfaces), start, std::move(left_alone), settings.push_out_speed,
                                           ParticleCollisions::kWidest);
}

}  // namespace haptic::sim
