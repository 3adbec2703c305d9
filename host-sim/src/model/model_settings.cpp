#include "haptic/sim/model_settings.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <stdexcept>

#include "haptic/setting.hpp"
#include "haptic/sim/elasticity.hpp"
#include "haptic/sim/material.hpp"
#include "haptic/sim/mesh_file.hpp"
#include "mesh/mesh_measures.hpp"
#include "mesh/refinement.hpp"
#include "model/generator_table.hpp"
#include "model/material_settings.hpp"
#include "model/model_file.hpp"
#include "model/regions.hpp"
#include "model/sample_graph.hpp"
#include "simd/aabb.hpp"

namespace haptic::sim {
namespace {

bool is_identity(const Placement& placement) {
    return placement.position == Vec3(0.0) && placement.orientation == Quat(1.0, 0.0, 0.0, 0.0) &&
           placement.velocity == Vec3(0.0);
}

/// The mesh of the file in metres, as it is in the file.
TriangleMesh given_mesh(const ModelSettings& settings) {
    if (!settings.mesh && settings.file_scale > 0.0) {
        MeshFileSettings file_settings;
        file_settings.scale = settings.file_scale;
        return load_mesh(settings.file, file_settings);
    }
    TriangleMesh mesh = settings.mesh ? *settings.mesh : load_mesh(settings.file);
    // Centred and as long as the generated body, unless the file's unit is given.
    double scale = settings.file_scale;
    Vec3 origin(0.0);
    if (!(scale > 0.0)) {
        const Aabb box = aabb_of(mesh.vertices);
        const Vec3 size = box.size();
        scale = generator_entry(settings.generator).length(settings) / std::max({size.x, size.y, size.z});
        origin = box.center();
    }
    for (Vec3& p : mesh.vertices) {
        p = scale * (p - origin);
    }
    return mesh;
}

/// The mesh of the file in metres, without edges that are too long.
TriangleMesh mesh_of_file(const ModelSettings& settings) {
    TriangleMesh mesh = given_mesh(settings);
    if (!(settings.max_edge > 0.0)) {
        return mesh;
    }
    const std::size_t max_vertices = MeshCheckSettings{}.max_triangles / 2;
    mesh = refined(mesh, settings.max_edge, max_vertices);
    if (mesh.vertices.size() > max_vertices) {
        settings.place.of("max_edge")
            .fail("divides the mesh into more than " + std::to_string(max_vertices) + " vertices; allow longer edges");
    }
    return mesh;
}

void set_compliances(const ModelSettings& settings, ParticleModel& model) {
    for (Group& group : model.groups) {
        group.compliance = settings.group_compliance;
    }
    for (Link& link : model.links) {
        link.compliance = settings.link_compliance;
    }
}

/// Whether a material of this body is a sheet: an open mesh with a particle at each vertex.
bool is_sheet(const DeformableBody& body) {
    return !body.mesh.closed && body.particles.size() == body.mesh.vertices.size();
}

/// The value of each particle: that of the last region that names a material for it, else that of the body.
template <class Material, class Resolve>
std::vector<Material> materials_of(const ModelSettings& settings, const MaterialSettings& of_body,
                                   const Placement& placement, const DeformableBody& body, const Resolve& resolve) {
    const Material whole = resolve(of_body, Material{});
    std::vector<Material> material(body.particles.size(), whole);
    for (const Region& region : settings.regions) {
        if (!region.material) {
            continue;
        }
        const Material inside = resolve(*region.material, whole);
        const RegionBox box(region, placement);
        for (std::size_t i = 0; i < material.size(); ++i) {
            if (box.contains(body.particles.rest_position[i])) {
                material[i] = inside;
            }
        }
    }
    return material;
}

/// Refuses particles of a solid that are all on its surface: what is between them would have no material.
void check_inside(const ModelSettings& settings, const DeformableBody& body) {
    if (body.particles.rest_position == body.mesh.vertices) {
        settings.place.of(settings.particles.empty() ? "particles_count" : "particles")
            .fail(
                "puts a particle at each of the " + std::to_string(body.particles.size()) +
                " vertices and none inside. A solid with a material needs some there: give the number of particles to "
                "distribute, for example particles_count = 200");
    }
}

/// Replaces groups and links by the elasticity of the material, and sets the masses.
void set_material(const ModelSettings& settings, const MaterialSettings& of_body, const Placement& placement,
                  DeformableBody& body) {
    ParticleModel& model = body.particles;
    if (is_sheet(body)) {
        const auto material = materials_of<SheetMaterial>(settings, of_body, placement, body, sheet_of);
        // A third of each triangle for each of its corners.
        std::fill(model.mass.begin(), model.mass.end(), 0.0);
        const std::size_t faces = body.mesh.triangles.size() / (body.mesh.double_faced ? 2 : 1);
        for (std::size_t t = 0; t < faces; ++t) {
            const Triangle& corner = body.mesh.triangles[t];
            const std::vector<Vec3>& x = model.rest_position;
            const double area = 0.5 * glm::length(glm::cross(x[corner[1]] - x[corner[0]], x[corner[2]] - x[corner[0]]));
            for (const std::uint32_t i : corner) {
                model.mass[i] += material[i].areal_density * area / 3.0;
            }
        }
        model.elasticity = make_sheet(model, body.mesh, material);
    } else if (body.mesh.closed) {
        const auto material = materials_of<SolidMaterial>(settings, of_body, placement, body, solid_of);
        check_inside(settings, body);
        // The builder has divided the mass by the volume of the cells.
        double total = 0.0;
        for (const double mass : model.mass) {
            total += mass;
        }
        const double volume = std::abs(signed_volume(body.mesh));
        for (std::size_t i = 0; i < model.size(); ++i) {
            model.mass[i] *= material[i].density * volume / total;
        }
        model.elasticity = make_solid(model, material);
    } else {
        settings.place.of(settings.particles.empty() ? "particles_count" : "particles")
            .fail("makes " + std::to_string(body.particles.size()) +
                  " particles, but an open mesh with a material is a "
                  "sheet, which needs one at each of its " +
                  std::to_string(body.mesh.vertices.size()) + " vertices; particles_count = 0 makes those");
    }
    model.groups.clear();
    model.links.clear();
}

/// The particles with their mesh and skin, about the origin, or a cloth in its place.
DeformableBody body_as_built(const ModelSettings& settings, const Progress& progress) {
    if (!settings.particles.empty()) {
        const TriangleMesh mesh =
            settings.file.empty() ? generator_entry(settings.generator).make_mesh(settings) : mesh_of_file(settings);
        return read_model_file(Config::load(settings.particles), mesh, settings.builder.bridge, progress);
    }
    DeformableBody body;
    if (settings.file.empty()) {
        body = generate_body(settings, progress);
    } else {
        body = build_body(mesh_of_file(settings), settings.builder, progress);
        body.name = std::filesystem::path(settings.file).stem().string();
    }
    set_compliances(settings, body.particles);
    return body;
}

/// The body, built at `placement`, with its material and regions.
DeformableBody body_at(const ModelSettings& settings, const Placement& placement, const Progress& progress) {
    DeformableBody body = body_as_built(settings, progress);
    if (settings.material) {
        set_material(settings, *settings.material, placement, body);
    }
    apply_regions(settings, placement, body);
    // Last, because pressures are divided by the gradients before the balance.
    balance_surface(body.particles, body.mesh, body.particles.elasticity);
    return body;
}

/// The same. Whatever reads meshes and makes particles and elements of them knows no settings: its errors get the place
/// of the mesh.
DeformableBody placed_body(const ModelSettings& settings, const Placement& placement, const Progress& progress) {
    const Config::Place mesh = settings.file.empty() ? settings.place : settings.place.of("file");
    try {
        return body_at(settings, placement, progress);
    } catch (const MeshError& error) {
        mesh.fail(error.what());
    } catch (const std::invalid_argument& error) {
        mesh.fail(error.what());
    }
}

/// The cloth as the thesis' scene has it, to the last bit: it is made where it falls from, not moved there.
bool is_made_in_place(const ModelSettings& settings) {
    return settings.generator == Generator::Cloth && settings.file.empty() && settings.particles.empty();
}

}  // namespace

DeformableBody make_body(const ModelSettings& settings, const Progress& progress) {
    ModelSettings centred = settings;
    centred.cloth.centre = Vec3(0.0);
    centred.cloth.orientation = Quat(1.0, 0.0, 0.0, 0.0);
    return placed_body(centred, Placement{}, progress);
}

bool is_rigid(const ModelSettings& settings) noexcept {
    return settings.file.empty() && settings.particles.empty() &&
           (settings.generator == Generator::Plate || settings.generator == Generator::Rod);
}

std::size_t expected_triangles(const ModelSettings& settings) {
    if (!settings.file.empty()) {
        return 0;
    }
    return generator_entry(settings.generator).triangles(settings) * settings.copies.size();
}

std::vector<DeformableBody> make_bodies(const ModelSettings& settings, const Progress& progress) {
    DeformableBody body;
    if (is_made_in_place(settings)) {
        body = placed_body(settings, {settings.cloth.centre, settings.cloth.orientation, Vec3(0.0)}, progress);
    } else {
        body = make_body(settings, progress);
        place(body, settings.placement);
    }
    for (std::size_t i = 0; i < body.particles.size(); ++i) {
        body.particles.velocity[i] = body.particles.pinned[i] != 0 ? Vec3(0.0) : settings.velocity;
    }
    std::vector<DeformableBody> bodies;
    for (const Placement& placement : settings.copies) {
        bodies.push_back(body);
        if (!is_identity(placement)) {
            place(bodies.back(), placement);
        }
    }
    return bodies;
}

}  // namespace haptic::sim
