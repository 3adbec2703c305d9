#include "view/capture.hpp"

#include <cstddef>
#include <glm/geometric.hpp>

#include "haptic/contact_problem.hpp"
#include "haptic/frames.hpp"
#include "haptic/sim/scene.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::sim::view {
namespace {

bool closes(const Scene& scene) {
    return scene.tool && scene.tool->shape == ToolShape::Hand && scene.tool->file.empty();
}

void describe_bodies(const Simulation& simulation, SceneDescription& out) {
    const std::vector<SceneBody>& bodies = simulation.bodies();
    for (std::size_t b = 0; b < bodies.size(); ++b) {
        const std::size_t next = b + 1 < bodies.size() ? bodies[b + 1].first_particle : simulation.model().size();
        out.bodies.push_back({.name = bodies[b].name,
                              .first_vertex = bodies[b].first_vertex,
                              .vertices = bodies[b].mesh.vertices.size(),
                              .triangles = bodies[b].mesh.triangles,
                              .first_particle = bodies[b].first_particle,
                              .particles = next - bodies[b].first_particle});
    }
}

/// m, scene: a material point of a body's surface.
Vec3 point_on(const Simulation& simulation, const SurfacePoint& touched) {
    const SceneBody& body = simulation.bodies()[touched.object];
    Vec3 point(0.0);
    for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t vertex = body.first_vertex + body.mesh.triangles[touched.triangle][k];
        point += touched.weights[static_cast<Vec3::length_type>(k)] * simulation.vertices()[vertex];
    }
    return point;
}

/// Appends the planes that were sent for one proxy, with the velocities of the contact frame, in scene units.
void add_planes(const Simulation& simulation, std::size_t proxy, SceneSnapshot& out) {
    const ToolProxy& particle = simulation.tool().particles()[proxy];
    const ContactFrame& frame = simulation.frame();
    // The frame's velocities are in the device frame; divide by the workspace's scale.
    const bool sent = proxy < frame.proxy_count && frame.proxies[proxy].plane_count == particle.planes.count;
    for (std::size_t p = 0; p < particle.planes.count; ++p) {
        const SurfacePlane& plane = particle.planes.plane[p];
        const double velocity =
            sent ? frame.proxies[proxy].planes[p].velocity / simulation.workspace().settings().scale : plane.velocity;
        out.planes.push_back({.normal = plane.normal,
                              .offset = plane.offset,
                              .velocity = velocity,
                              .proxy = static_cast<std::uint32_t>(proxy),
                              .touches = p < particle.contacts.count});
    }
}

void add_forces(const Simulation& simulation, SceneSnapshot& out) {
    for (const SurfaceForce& surface : simulation.surface_forces()) {
        if (surface.force > 0.0) {
            out.forces.push_back({.point = point_on(simulation, surface.plane.touched),
                                  .normal = surface.plane.normal,
                                  .force = surface.force,
                                  .body = surface.plane.touched.object,
                                  .proxy = surface.proxy});
        }
    }
}

float float_microseconds(std::int64_t duration_ns) noexcept {
    return static_cast<float>(duration_ns) * 1e-3F;
}

}  // namespace

SceneDescription describe(const Simulation& simulation) {
    const Scene& scene = simulation.scene();
    SceneDescription out;
    out.name = scene.name;
    out.text = scene.description;
    for (const BuiltInScene& other : built_in_scenes()) {
        out.scenes.emplace_back(other.name);
    }
    describe_bodies(simulation, out);
    // Particle model: ellipsoids, shape-matching groups and links.
    out.semi_axes = simulation.model().semi_axes;
    out.ellipsoid_axes = simulation.model().axes;
    out.groups = simulation.model().groups;
    out.links = simulation.model().links;
    // Tool: skin and proxies.
    out.tool_triangles = simulation.tool().mesh().triangles;
    out.tool_vertices = simulation.tool().mesh().vertices.size();
    for (const ToolProxy& particle : simulation.tool().particles()) {
        out.proxy_radii.push_back(particle.radius);
    }
    if (scene.collisions.ground) {
        out.ground_height = scene.collisions.ground_height;
    }
    out.step = scene.solver.step;
    out.mask_radius = scene.coupling.mask_radius;
    out.force_scale = scene.workspace.force_scale;
    out.closes = closes(scene);
    return out;
}

void make_room(const Simulation& simulation, SceneSnapshot& out) {
    out.vertices.resize(simulation.vertices().size());
    out.particles.resize(simulation.model().size());
    out.orientations.resize(simulation.model().size());
    out.tool_vertices.resize(simulation.tool().mesh().vertices.size());
    out.proxies.resize(simulation.tool().particles().size());
    out.planes.reserve(kMaxSurfacePlanes * simulation.tool().particles().size());
    out.forces.reserve(kMaxContactRows);
}

void capture(const Simulation& simulation, const StepResult& result, SceneSnapshot& out) {
    const ParticleModel& model = simulation.model();
    out.step = simulation.steps();
    // Bodies: skinned vertices and the particles that drive them.
    out.time = simulation.time();
    out.vertices.assign(simulation.vertices().begin(), simulation.vertices().end());
    out.particles.assign(model.position.begin(), model.position.end());
    out.orientations.assign(model.orientation.begin(), model.orientation.end());
    // Tool: its skin, its proxies and their contact planes.
    const ToolProxies& tool = simulation.tool();
    out.tool_vertices.resize(tool.mesh().vertices.size());
    tool.vertices(out.tool_vertices);
    out.proxies.resize(tool.particles().size());
    out.planes.clear();
    out.forces.clear();
    add_forces(simulation, out);
    for (std::size_t i = 0; i < out.proxies.size(); ++i) {
        const ToolProxy& particle = tool.particles()[i];
        out.proxies[i] = {.position = particle.position,
                          .goal = particle.goal,
                          .radius = particle.radius,
                          .touches = particle.in_contact(),
                          .sticks = particle.sticks()};
        add_planes(simulation, i, out);
    }
    // Poses, wrench and contact state of this step.
    const Workspace& workspace = simulation.workspace();
    out.device = {.centre = workspace.to_scene(Vec3(0.0)),
                  .orientation = glm::conjugate(workspace.settings().rotation),
                  .scale = 1.0 / workspace.settings().scale};
    out.tool = tool.pose();
    out.hip = tool.hip();
    out.force = result.force;
    out.torque = result.torque;
    out.hand_force = result.hand_force;
    out.hand_torque = result.hand_torque;
    out.curl = result.curl;
    out.depth = result.depth;
    out.in_contact = result.in_contact;
    out.overconstrained = result.overconstrained;
}

StepSample sample_of(const StepResult& result) noexcept {
    const StageTimes& t = result.times;
    return {.time = result.time,
            .force = static_cast<float>(glm::length(result.hand_force)),
            .torque = static_cast<float>(glm::length(result.hand_torque)),
            .depth = static_cast<float>(result.depth),
            .total_us = float_microseconds(t.total_ns),
            .ccd_us = float_microseconds(t.ccd_ns),
            .popout_us = float_microseconds(t.popout_ns),
            .proxy_us = float_microseconds(t.proxy_ns),
            .tool_us = float_microseconds(t.tool_ns),
            .collide_us = float_microseconds(t.collide_ns),
            .deform_us = float_microseconds(t.deform_ns),
            .skin_us = float_microseconds(t.skin_ns)};
}

}  // namespace haptic::sim::view
