#include "model/regions.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/matrix.hpp>
#include <iomanip>
#include <limits>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "dynamics/rotation.hpp"
#include "haptic/sim/elasticity.hpp"
#include "haptic/sim/material.hpp"
#include "mesh/mesh_measures.hpp"
#include "mesh/refinement.hpp"

namespace haptic::sim {
namespace {

constexpr std::uint32_t kNotInPart = std::numeric_limits<std::uint32_t>::max();
constexpr double kPieceOfSpacing = 0.5;  // longest edge under pressure, per spacing of the particles
constexpr std::size_t kMaxPressedVertices = 20'000;

/// The region says something of particles, not only of the surface.
bool concerns_particles(const Region& region) {
    const bool presses_only = region.pressure != 0.0 && region.force == Vec3(0.0) && !region.fixed &&
                              !region.stiffness && !region.material && region.motion_times.empty();
    return !presses_only;
}

std::string shown(const Vec3& v) {
    std::ostringstream text;
    text << std::setprecision(3) << '[' << v.x << ", " << v.y << ", " << v.z << ']';
    return text.str();
}

/// Throws ConfigError, which says where the particles are.
[[noreturn]] void refuse_empty(const Region& region, const RegionBox& box, const ParticleModel& model) {
    Vec3 low(std::numeric_limits<double>::infinity());
    Vec3 high = -low;
    for (const Vec3& rest : model.rest_position) {
        low = glm::min(low, box.in_body(rest));
        high = glm::max(high, box.in_body(rest));
    }
    region.place.fail("has no particle in it; the particles are from " + shown(low) + " to " + shown(high) +
                      " m in the body's own frame, in which low and high are");
}

/// Pins and drives the particles of one region, and sets the stiffness of their groups.
void apply(const Region& region, const Placement& placement, bool may_be_empty, DeformableBody& body) {
    ParticleModel& model = body.particles;
    const RegionBox box(region, placement);
    std::vector<std::uint8_t> inside(model.size(), 0);
    Motion motion{{}, region.motion_times, region.motion_offsets, region.motion_repeat};
    for (std::uint32_t i = 0; i < model.size(); ++i) {
        if (box.contains(model.rest_position[i])) {
            inside[i] = 1;
            motion.particles.push_back(i);
        }
    }
    if (motion.particles.empty() && (may_be_empty || !concerns_particles(region))) {
        return;
    }
    if (motion.particles.empty()) {
        refuse_empty(region, box, model);
    }
    if (region.stiffness) {
        for (Group& group : model.groups) {
            if (inside[group.centre] != 0) {
                group.stiffness = *region.stiffness;
            }
        }
    }
    const bool has_motion = !motion.times.empty();
    if (!region.fixed && !has_motion) {
        return;
    }
    for (const std::uint32_t i : motion.particles) {
        model.pinned[i] = 1;
    }
    // The last motion of a particle replaces earlier ones.
    for (Motion& earlier : body.motions) {
        std::erase_if(earlier.particles, [&](std::uint32_t i) { return inside[i] != 0; });
    }
    std::erase_if(body.motions, [](const Motion& earlier) { return earlier.particles.empty(); });
    if (has_motion) {
        const Mat3 scene_from_body = to_matrix(placement.orientation);
        for (Vec3& offset : motion.offsets) {
            offset = scene_from_body * offset;
        }
        body.motions.push_back(std::move(motion));
    }
}

/// The free particles in the box, each with its part of their mass.
std::vector<ParticleWeight> shares_of_mass(const ParticleModel& model, const RegionBox& box) {
    std::vector<ParticleWeight> shares;
    double total = 0.0;
    for (std::uint32_t i = 0; i < model.size(); ++i) {
        if (model.pinned[i] == 0 && box.contains(model.rest_position[i])) {
            shares.push_back({i, model.mass[i]});
            total += model.mass[i];
        }
    }
    for (ParticleWeight& share : shares) {
        share.weight /= total;
    }
    return shares;
}

struct MeshPart {
    TriangleMesh mesh;
    std::vector<std::uint32_t> vertices;  // of the whole mesh, for each vertex of the part
};

/// The triangles with all corners in the box, once each of a double-faced mesh.
MeshPart part_in_box(const TriangleMesh& mesh, const RegionBox& box) {
    MeshPart part;
    std::vector<std::uint32_t> index_of(mesh.vertices.size(), kNotInPart);
    const auto index_in_part = [&](std::uint32_t vertex) {
        if (index_of[vertex] == kNotInPart) {
            index_of[vertex] = static_cast<std::uint32_t>(part.vertices.size());
            part.vertices.push_back(vertex);
            part.mesh.vertices.push_back(mesh.vertices[vertex]);
        }
        return index_of[vertex];
    };
    const std::size_t faces = mesh.triangles.size() / (mesh.double_faced ? 2 : 1);
    for (std::size_t t = 0; t < faces; ++t) {
        const Triangle& corners = mesh.triangles[t];
        if (std::all_of(corners.begin(), corners.end(),
                        [&](std::uint32_t vertex) { return box.contains(mesh.vertices[vertex]); })) {
            part.mesh.triangles.push_back(
                {index_in_part(corners[0]), index_in_part(corners[1]), index_in_part(corners[2])});
        }
    }
    return part;
}

/// m, between neighbouring particles.
double spacing_in(const DeformableBody& body) {
    const double count = static_cast<double>(body.particles.size());
    return body.mesh.closed ? std::cbrt(std::abs(signed_volume(body.mesh)) / count)
                            : std::sqrt(surface_area(body.mesh) / count);
}

PressedSurface pressed_surface(const DeformableBody& body, const RegionBox& box) {
    const ParticleModel& model = body.particles;
    MeshPart part = part_in_box(body.mesh, box);
    PressedSurface surface;
    if (model.rest_position == body.mesh.vertices) {
        for (const std::uint32_t vertex : part.vertices) {
            surface.vertices.push_back({{vertex, 1.0}});
        }
    } else {
        // Points finer than the particles, so that the force of each element's part of the surface is that of its area.
        part.mesh = refined(part.mesh, kPieceOfSpacing * spacing_in(body), kMaxPressedVertices);
        // Bodies without a material have groups in place of elements: those of any material carry points alike.
        const bool has_elements = !model.elasticity.elements.empty();
        const Elasticity of_groups =
            has_elements ? Elasticity{} : make_solid(model, std::vector<SolidMaterial>(model.size()));
        for (const Vec3& at : part.mesh.vertices) {
            surface.vertices.push_back(carriers_of(model, has_elements ? model.elasticity : of_groups, at));
        }
    }
    surface.triangles = std::move(part.mesh.triangles);
    surface.position.resize(surface.vertices.size());
    surface.force.resize(surface.vertices.size());
    return surface;
}

/// A particle that carries the surface can move.
bool can_yield(const PressedSurface& surface, const ParticleModel& model) {
    return std::any_of(
        surface.vertices.begin(), surface.vertices.end(), [&](const std::vector<ParticleWeight>& carriers) {
            return std::any_of(carriers.begin(), carriers.end(),
                               [&](const ParticleWeight& carrier) { return model.pinned[carrier.particle] == 0; });
        });
}

/// Adds the load of one region. Precondition: it is known which particles are pinned.
void add_load(const Region& region, const Placement& placement, DeformableBody& body) {
    const RegionBox box(region, placement);
    Load load{.times = region.load_times, .factors = region.load_factors, .repeat = region.load_repeat};
    if (region.force != Vec3(0.0)) {
        load.force = region.force;
        load.shares = shares_of_mass(body.particles, box);
        if (load.shares.empty()) {
            region.place.of("force").fail(
                "has a force, but no particle in it can move: they are fixed or driven, or there are none. "
                "Enlarge the box, in the body's own frame, or free its particles");
        }
    }
    if (region.pressure != 0.0) {
        load.pressure = region.pressure;
        load.surface = pressed_surface(body, box);
        if (load.surface.triangles.empty()) {
            region.place.of("pressure")
                .fail(
                    "has a pressure, but no triangle of the surface has all its corners in it. Enlarge the box, "
                    "in the body's own frame, so that it contains a part of the surface");
        }
        if (!can_yield(load.surface, body.particles)) {
            region.place.of("pressure")
                .fail(
                    "has a pressure, but the particles behind its surface are all fixed or driven. Free some of "
                    "them, or leave the pressure out");
        }
    }
    if (!load.shares.empty() || !load.surface.triangles.empty()) {
        body.loads.push_back(std::move(load));
    }
}

}  // namespace

RegionBox::RegionBox(const Region& region, const Placement& placement)
    : low_(region.low),
      high_(region.high),
      origin_(placement.position),
      body_from_scene_(glm::transpose(to_matrix(placement.orientation))) {}

Vec3 RegionBox::in_body(const Vec3& rest) const noexcept {
    return body_from_scene_ * (rest - origin_);
}

bool RegionBox::contains(const Vec3& rest) const noexcept {
    const Vec3 p = in_body(rest);
    return p.x >= low_.x && p.y >= low_.y && p.z >= low_.z &&  //
           p.x <= high_.x && p.y <= high_.y && p.z <= high_.z;
}

void apply_regions(const ModelSettings& settings, const Placement& placement, DeformableBody& body) {
    for (const Region& region : settings.regions) {
        apply(region, placement, !settings.file.empty(), body);
    }
    // A load counts for the particles that no region pins.
    for (const Region& region : settings.regions) {
        add_load(region, placement, body);
    }
}

}  // namespace haptic::sim
