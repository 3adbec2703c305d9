#include "scene/contact_frame_builder.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "contact/contact_points.hpp"
#include "dynamics/rotation.hpp"
#include "haptic/contact_problem.hpp"

namespace haptic::sim {
namespace {

/// How dispensable a plane is; larger is dropped first.
enum class PlaneRank : std::uint8_t { FirstContact, Contact, NearContact, Near };

std::size_t count_rows(const ContactFrame& frame) {
    std::size_t rows = 0;
    for (std::size_t i = 0; i < frame.proxy_count; ++i) {
        rows += contact_rows(frame.proxies[i]);
    }
    return rows;
}

void drop_plane(ProxyContact& proxy, std::size_t plane) {
    std::copy(&proxy.planes[plane + 1], &proxy.planes[proxy.plane_count], &proxy.planes[plane]);
    proxy.planes[--proxy.plane_count] = {};
    // Tangents need a plane.
    proxy.in_contact &= proxy.plane_count > 0 ? ~0U : ~std::uint32_t{HAPTIC_PROXY_TANGENTS};
}

}  // namespace

/// m, scene: displacement of a touched point from t to t + dt.
Vec3 ContactFrameBuilder::travel_of(const SurfacePoint& touched) const {
    const SceneBody& body = sources_.bodies[touched.object];
    const std::size_t count = body.mesh.vertices.size();
    return displacement_of({sources_.start.subspan(body.first_vertex, count),
                            sources_.end.subspan(body.first_vertex, count), body.mesh.triangles},
                           touched.triangle, touched.weights);
}

void ContactFrameBuilder::write_proxy_contact(std::size_t index, ProxyContact& out) const {
    const ToolProxy& proxy = sources_.tool.particles()[index];
    const Workspace& workspace = sources_.workspace;
    const double inverse_step = 1.0 / sources_.scene.solver.step;
    const Lead& lead = sources_.coupling.lead(index);
    // The point at which the proxy's springs pull: with positions, its goal.
    const bool positions = sources_.scene.coupling.multi_rate == MultiRate::Positions;
    store(workspace.offset_to_grip(positions ? proxy.rest_offset : proxy.free_offset), out.rest_offset);
    store(workspace.offset_to_grip(proxy.rest_velocity), out.rest_velocity);
    const double radius = workspace.settings().scale * sources_.tool.rolling_radius(proxy);
    out.radius = positions ? 0.0 : std::min(radius, kMaxProxyRadius);
    store(workspace.to_device(positions ? proxy.position : sources_.tool.unturned_position(proxy)), out.position);
    out.in_contact = (proxy.in_contact() ? std::uint32_t{HAPTIC_PROXY_TOUCHES} : 0u) |
                     (proxy.sticks() ? std::uint32_t{HAPTIC_PROXY_STICKS} : 0u);
    out.plane_count = proxy.planes.count;

    // Each plane gets the offset and the velocity that its force has in the step that begins now. The contacts come
    // first among the planes.
    const std::size_t contacts = proxy.contacts.count;
    Vec3 carried(0.0);  // m, displacement of the point that a sticking proxy is held to
    for (std::size_t p = 0; p < proxy.planes.count; ++p) {
        SurfacePlane plane = proxy.planes.plane[p];
        const Vec3 travel = travel_of(plane.touched);
        // offset + lead at t; at t + dt the touched point has travelled and the lead has changed. Only a plane that the
        // free position is behind leads, and never so that it pulls.
        const double moved = glm::dot(plane.normal, travel);
        const double depth = plane.offset - glm::dot(plane.normal, proxy.free_position);
        const auto lead_along = [&](const Vec3& ahead, double depth_then) {
            return depth_then > 0.0 ? std::max(glm::dot(plane.normal, ahead), -depth_then) : 0.0;
        };
        const double start = lead_along(lead.start, depth);
        const double end = lead_along(lead.end, depth + moved);
        plane.offset += start;
        plane.velocity = (moved + end - start) * inverse_step;
        out.planes[p] = workspace.to_device(plane);
        // Contacts weighted by their part of the normal force; without contact, the nearest plane alone.
        if (p < contacts || p == 0) {
            carried += (contacts > 0 ? proxy.friction.share[p] : 1.0) * travel;
        }
    }
    if (sources_.tool.has_friction()) {
        out.in_contact |= proxy.planes.count > 0 ? std::uint32_t{HAPTIC_PROXY_TANGENTS} : 0u;
        store(workspace.velocity_to_device(carried * inverse_step), out.surface_velocity);
    }
}

/// Drops planes until the rows fit: the farthest speculative planes of proxies that touch nothing, then those of the
/// others, then contacts beyond the first of a proxy.
void ContactFrameBuilder::limit_rows(ContactFrame& frame) const {
    std::array<std::size_t, kMaxProxies> contacts{};
    for (std::size_t i = 0; i < frame.proxy_count; ++i) {
        contacts[i] = sources_.tool.particles()[i].contacts.count;
    }
    while (count_rows(frame) > kMaxComplianceRows) {
        // Most dispensable plane: by rank, then by its distance from the proxy.
        PlaneRank worst_rank = PlaneRank::FirstContact;
        double worst_distance = 0.0;
        std::size_t worst_proxy = 0;
        std::size_t worst_plane = 0;
        for (std::size_t i = 0; i < frame.proxy_count; ++i) {
            const ProxyContact& proxy = frame.proxies[i];
            for (std::size_t p = 0; p < proxy.plane_count; ++p) {
                const PlaneRank rank = p >= contacts[i] ? (contacts[i] > 0 ? PlaneRank::NearContact : PlaneRank::Near)
                                                        : (p > 0 ? PlaneRank::Contact : PlaneRank::FirstContact);
                const double distance =
                    glm::dot(to_vec3(proxy.planes[p].normal), to_vec3(proxy.position)) - proxy.planes[p].offset;
                if (rank > worst_rank || (rank == worst_rank && distance >= worst_distance)) {
                    worst_rank = rank;
                    worst_distance = distance;
                    worst_proxy = i;
                    worst_plane = p;
                }
            }
        }
        drop_plane(frame.proxies[worst_proxy], worst_plane);
        contacts[worst_proxy] = std::min<std::size_t>(contacts[worst_proxy], frame.proxies[worst_proxy].plane_count);
    }
}

/// k W_rs = k d_r . C_ij d_s of the tool and its coupling; the workspace's scales and the clutch change k and W only.
void ContactFrameBuilder::write_compliance(ContactFrame& frame) const {
    const WorkspaceSettings& workspace = sources_.workspace.settings();
    const ToolElasticity& elasticity = sources_.tool.elasticity();
    // Rows in the order of the frame.
    std::array<ToolElasticity::Push, kMaxComplianceRows> rows;  // NOLINT(*-member-init): filled below
    std::size_t count = 0;
    const Mat3 scene_from_device = glm::transpose(to_matrix(workspace.rotation));
    for (std::size_t i = 0; i < frame.proxy_count; ++i) {
        const ProxyContact& proxy = frame.proxies[i];
        for (std::size_t p = 0; p < proxy.plane_count; ++p) {
            rows[count++] = sources_.tool.push(i, scene_from_device * to_vec3(proxy.planes[p].normal), Vec3(0.0));
        }
        if ((proxy.in_contact & HAPTIC_PROXY_TANGENTS) != 0) {
            const Vec3 normal = to_vec3(proxy.planes[0].normal);
            const Vec3 arm = -sources_.tool.rolling_radius(sources_.tool.particles()[i]) * (scene_from_device * normal);
            for (const Vec3& tangent : contact_tangents(normal)) {
                rows[count++] = sources_.tool.push(i, scene_from_device * tangent, arm);
            }
        }
    }
    const double stiffness = sources_.scene.coupling.stiffness;
    frame.compliance_rows = static_cast<std::uint32_t>(count);
    for (std::size_t r = 0; r < count; ++r) {
        for (std::size_t s = 0; s <= r; ++s) {
            const double share = r == s ? stiffness : (1.0 - kSurfaceShare) * stiffness;
            frame.compliance[compliance_index(r, s)] =
                static_cast<float>(share * elasticity.compliance(rows[r], rows[s]));
        }
    }
}

void ContactFrameBuilder::build(ContactFrame& frame) const {
    const auto& [input, scene, workspace, clutch, tool, coupling, bodies, start, end, body_work] = sources_;
    frame = {};
    frame.state_sequence = input.state_sequence;
    frame.state_time_ns = input.state_time_ns;
    frame.plane_time_ns = input.time_ns;
    frame.publish_time_ns = input.time_ns;
    frame.step_ns = nanoseconds(scene.solver.step);

    // The clutch fades the coupling: the loop gets the stiffness in effect.
    frame.stiffness = clutch.gain() * workspace.coupling_to_device(scene.coupling.stiffness);
    frame.torque_stiffness = clutch.gain() * workspace.coupling_to_device(scene.coupling.torque_stiffness);
    frame.static_friction = scene.contact.static_friction;
    frame.dynamic_friction = scene.contact.dynamic_friction;
    frame.body_work = body_work;
    frame.flags = (tool.effort().overconstrained ? std::uint32_t{HAPTIC_FRAME_SQUEEZED} : 0u) |
                  (clutch.uncoupled() ? std::uint32_t{HAPTIC_FRAME_CLUTCHED} : 0u) |
                  (scene.coupling.multi_rate == MultiRate::Positions ? std::uint32_t{HAPTIC_FRAME_HOLD_POSITIONS} : 0u);
    for (std::size_t i = 0; i < tool.particles().size(); ++i) {
        write_proxy_contact(i, frame.proxies[frame.proxy_count++]);
    }
    // The contact problem; none while nothing couples the hand.
    if (frame.stiffness > 0.0 && scene.coupling.multi_rate == MultiRate::Planes) {
        limit_rows(frame);
        write_compliance(frame);
    }
}

}  // namespace haptic::sim
