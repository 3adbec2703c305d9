#include "scene/assembly.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include "dynamics/model_bodies.hpp"
#include "mesh/mesh_topology.hpp"

namespace haptic::sim {
namespace {

/// Faces that take part in contact. The thesis' methods get the second ones of a double-faced mesh, as in the thesis.
Faces touchable(const ContactSettings& contact) {
    const bool as_thesis = contact.method == CcdMethod::Thesis || contact.pop_out == PopOutMethod::Thesis;
    return as_thesis ? Faces::All : Faces::Single;
}

}  // namespace

Assembly::Assembly(const Scene& scene, const Progress& progress) {
    const double kinds = 1.0 + static_cast<double>(scene.objects.size());
    double made = 0.0;
    const auto add_all = [&](const ModelSettings& settings) {
        for (DeformableBody& body : make_bodies(settings, part_of(progress, made / kinds, (made + 1.0) / kinds))) {
            add(std::move(body), settings.place, scene);
        }
        made += 1.0;
        report(progress, made / kinds);
    };
    add_all(scene.model);
    for (const ModelSettings& object : scene.objects) {
        add_all(object);
    }
}

void Assembly::add(DeformableBody&& body, const Config::Place& place, const Scene& scene) {
    // Append mesh and skin, with the skin's particle indices shifted to the common array.
    const std::size_t vertices = mesh.vertices.size();
    const std::size_t particles = model.size();
    detail::append(mesh, body.mesh);
    for (SkinVertex vertex : body.skin) {
        for (std::uint32_t& carrier : vertex.particle) {
            carrier += static_cast<std::uint32_t>(particles);
        }
        skin.push_back(vertex);
    }
    model.append(body.particles);
    trees.emplace_back(body.mesh.vertices, body.mesh.triangles, touchable(scene.contact));
    masks.emplace_back(body.mesh, body.skin, body.particles.size(), scene.coupling.mask_radius);
    // What is fixed may be built into the ground; sheets are kept above it where they are.
    const bool movable = has_unpinned(body.particles, {0, static_cast<std::uint32_t>(body.particles.size())});
    const bool is_solid = !masks.back().vertices_are_particles() || !solids_of(body.particles).empty();
    const bool flattened = scene.collisions.ground && movable && is_solid;
    floor.push_back(flattened ? scene.collisions.ground_height : -std::numeric_limits<double>::infinity());
    motions.push_back(std::move(body.motions));
    loads.push_back(std::move(body.loads));
    places.push_back(place);
    bodies.push_back({std::move(body.name), vertices, particles, std::move(body.mesh)});
}

void Assembly::drive(double now_s, double step_s) {
    for (std::size_t b = 0; b < bodies.size(); ++b) {
        for (const Motion& motion : motions[b]) {
            const Vec3 after = offset_at(motion, now_s + step_s);
            for (const std::uint32_t particle : motion.particles) {
                const std::size_t i = bodies[b].first_particle + particle;
                model.velocity[i] = (model.rest_position[i] + after - model.position[i]) / step_s;
            }
        }
    }
}

ParticleRange Assembly::particles_of(std::size_t body) const {
    const Skinner::Part range = part(body);
    return {static_cast<std::uint32_t>(range.first_particle),
            static_cast<std::uint32_t>(range.first_particle + range.particles)};
}

const Config::Place& Assembly::place_of(std::uint32_t particle) const {
    const auto next = std::ranges::upper_bound(bodies, particle, {}, &SceneBody::first_particle);
    return places[static_cast<std::size_t>(next - bodies.begin()) - 1];
}

bool Assembly::is_movable(std::size_t body) const {
    return has_unpinned(model, particles_of(body));
}

bool Assembly::is_sheet(std::size_t body) const {
    const Skinner::Part range = part(body);
    const auto can_move = [&](const Triangle& t) {
        return std::ranges::none_of(t, [&](std::uint32_t v) { return model.pinned[range.first_particle + v] != 0; });
    };
    return range.vertices == range.particles && masks[body].vertices_are_particles() &&
           !has_body_at(solids_of(model), static_cast<std::uint32_t>(range.first_particle)) &&
           std::ranges::any_of(bodies[body].mesh.triangles, can_move);
}

}  // namespace haptic::sim
