#include "scene/contact_frame_builder.hpp"

#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>

#include "contact/contact_points.hpp"

namespace haptic::sim {

/// m, scene: displacement of a touched point from t to t + dt.
Vec3 ContactFrameBuilder::travel_of(const SurfacePoint& touched) const {
    const SceneBody& body = sources_.bodies[touched.object];
    const std::size_t count = body.mesh.vertices.size();
    return displacement_of({sources_.start.subspan(body.first_vertex, count),
                            sources_.end.subspan(body.first_vertex, count), body.mesh.triangles},
                           touched.triangle, touched.weights);
}

void ContactFrameBuilder::write_proxy_contact(const ToolProxy& proxy, ProxyContact& out) const {
    const Workspace& workspace = sources_.workspace;
    const double inverse_step = 1.0 / sources_.scene.solver.step;
    store(workspace.offset_to_grip(proxy.rest_offset), out.rest_offset);
    store(workspace.to_device(proxy.position), out.position);
    out.in_contact = (proxy.in_contact() ? std::uint32_t{HAPTIC_PROXY_TOUCHES} : 0u) |
                     (proxy.sticks() ? std::uint32_t{HAPTIC_PROXY_STICKS} : 0u);
    out.plane_count = proxy.planes.count;

    // Each plane gets the velocity that its touched point has in the step that begins now: the bodies have been stepped
    // already, so it is known rather than extrapolated. The contacts come first among the planes.
    const std::size_t contacts = proxy.contacts.count;
    Vec3 carried(0.0);  // m, displacement of the point that a sticking proxy is held to
    for (std::size_t p = 0; p < proxy.planes.count; ++p) {
        SurfacePlane plane = proxy.planes.plane[p];
        const Vec3 travel = travel_of(plane.touched);
        plane.velocity = glm::dot(plane.normal, travel) * inverse_step;
        out.planes[p] = workspace.to_device(plane);
        // Contacts weighted by their part of the normal force; without contact, the nearest plane alone.
        if (p < contacts || p == 0) {
            carried += (contacts > 0 ? proxy.friction.share[p] : 1.0) * travel;
        }
    }
    if (sources_.tool.has_friction()) {
        store(workspace.velocity_to_device(carried * inverse_step), out.surface_velocity);
    }
}

void ContactFrameBuilder::build(ContactFrame& frame) const {
    const auto& [input, scene, workspace, clutch, tool, damping, bodies, start, end] = sources_;
    frame = {};
    frame.state_sequence = input.state_sequence;
    frame.state_time_ns = input.state_time_ns;
    frame.plane_time_ns = input.time_ns;
    frame.publish_time_ns = input.time_ns;
    frame.step_ns = nanoseconds(scene.solver.step);

    // The clutch fades the coupling: the loop gets the stiffness in effect.
    frame.stiffness = clutch.gain() * workspace.coupling_to_device(scene.coupling.stiffness);
    frame.torque_stiffness = clutch.gain() * workspace.coupling_to_device(scene.coupling.torque_stiffness);
    frame.damping = workspace.coupling_to_device(damping);
    frame.static_friction = scene.contact.static_friction;
    frame.dynamic_friction = scene.contact.dynamic_friction;
    frame.flags = (tool.effort().overconstrained ? std::uint32_t{HAPTIC_FRAME_SQUEEZED} : 0u) |
                  (clutch.uncoupled() ? std::uint32_t{HAPTIC_FRAME_CLUTCHED} : 0u) |
                  (scene.coupling.share == ForceSharing::Series ? std::uint32_t{HAPTIC_FRAME_SERIES_SPRINGS} : 0u) |
                  (scene.coupling.multi_rate == MultiRate::Positions ? std::uint32_t{HAPTIC_FRAME_HOLD_POSITIONS} : 0u);
    for (const ToolProxy& proxy : tool.particles()) {
        write_proxy_contact(proxy, frame.proxies[frame.proxy_count++]);
    }
}

}  // namespace haptic::sim
