#include "reproduce/haptic_render.hpp"

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <span>

#include "contact/half_spaces.hpp"

namespace haptic::sim::reproduce {
namespace {

constexpr std::int64_t kTickNs = 1'000'000;
constexpr double kTolerance = 1e-12;  // m

/// The local proxy: the point nearest to `goal` within the half-spaces of a contact, `after_s` after the frame. Device
/// frame.
Vec3 local_proxy(const ProxyContact& contact, const Vec3& goal, double after_s) {
    std::array<HalfSpace, kMaxSurfacePlanes> half_spaces;
    const std::size_t count = std::min<std::size_t>(contact.plane_count, half_spaces.size());
    for (std::size_t p = 0; p < count; ++p) {
        const ContactPlane& plane = contact.planes[p];
        half_spaces[p].normal = {plane.normal[0], plane.normal[1], plane.normal[2]};
        half_spaces[p].offset = plane.offset + after_s * plane.velocity;
    }
    return project_onto(std::span(half_spaces).first(count), goal, kTolerance).point;
}

Vec3 vec3(const double (&values)[3]) {
    return {values[0], values[1], values[2]};
}

}  // namespace

void render_haptics(const Simulation& simulation, const ContactFrame& frame, std::int64_t from_ns,
                    std::int64_t until_ns, std::vector<HapticSample>& samples) {
    const Workspace& workspace = simulation.workspace();
    const CouplingSettings& coupling = simulation.scene().coupling;
    const double share = 1.0 / std::max(1.0, static_cast<double>(frame.proxy_count));
    const double torque_stiffness = coupling.torque_stiffness > 0.0 ? coupling.torque_stiffness : coupling.stiffness;
    const bool holds_positions = (frame.flags & HAPTIC_FRAME_HOLD_POSITIONS) != 0;
    // Ticks at whole milliseconds, whatever the step of the simulation.
    for (std::int64_t time_ns = (from_ns + kTickNs - 1) / kTickNs * kTickNs; time_ns < until_ns; time_ns += kTickNs) {
        const Pose device = simulation.scripted_input(time_ns).device;
        HapticSample sample;
        sample.time_s = seconds(time_ns);
        sample.hip = workspace.to_scene(device.position);
        sample.proxy = sample.hip;
        for (std::size_t i = 0; i < frame.proxy_count; ++i) {
            const ProxyContact& contact = frame.proxies[i];
            if (holds_positions && contact.in_contact == 0) {
                continue;
            }
            // Local proxy of the goal at this tick, in the device frame.
            const Vec3 goal = device.position + device.orientation * vec3(contact.rest_offset);
            const Vec3 held = holds_positions ? vec3(contact.position)
                                              : local_proxy(contact, goal, seconds(time_ns - frame.plane_time_ns));
            if (i == 0) {
                sample.proxy = workspace.to_scene(held);
            }
            if (held == goal) {
                continue;
            }
            // Section 5.2.2: this proxy's share of force and torque, in the scene.
            const Vec3 scene_goal = workspace.to_scene(goal);
            const Vec3 displacement = workspace.to_scene(held) - scene_goal;
            sample.force += coupling.stiffness * share * displacement;
            sample.torque += torque_stiffness * share * glm::cross(scene_goal - sample.hip, displacement);
            ++sample.collided;
        }
        samples.push_back(sample);
    }
}

}  // namespace haptic::sim::reproduce
