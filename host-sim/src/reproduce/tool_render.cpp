#include "reproduce/tool_render.hpp"

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <utility>

#include "contact/half_spaces.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::sim::reproduce {
namespace {

constexpr std::int64_t kTickNs = 1'000'000;
constexpr double kTolerance = 1e-12;  // m

/// Where a particle is held while the hand has it at `goal`, in the device's frame.
Vec3 held_at(const ProxyContact& particle, const Vec3& goal, double after_s) {
    std::array<HalfSpace, kMaxSurfacePlanes> half_spaces;
    const std::size_t count = std::min<std::size_t>(particle.plane_count, half_spaces.size());
    for (std::size_t p = 0; p < count; ++p) {
        const ContactPlane& plane = particle.planes[p];
        half_spaces[p].normal = {plane.normal[0], plane.normal[1], plane.normal[2]};
        half_spaces[p].offset = plane.offset + after_s * plane.velocity;
    }
    return project_onto(std::span(half_spaces).first(count), goal, kTolerance).point;
}

Vec3 vec3(const double (&values)[3]) {
    return {values[0], values[1], values[2]};
}

constexpr std::array kSkinColour{0.87, 0.63, 0.50};

}  // namespace

void render_tool(const Simulation& simulation, const ContactFrame& frame, std::int64_t from_ns, std::int64_t until_ns,
                 std::vector<ToolSample>& samples) {
    const Workspace& workspace = simulation.workspace();
    const CouplingSettings& coupling = simulation.scene().coupling;
    const double part = 1.0 / std::max(1.0, static_cast<double>(frame.proxy_count));
    const double turning = coupling.torque_stiffness > 0.0 ? coupling.torque_stiffness : coupling.stiffness;
    const bool holds = (frame.flags & HAPTIC_FRAME_HOLD_POSITIONS) != 0;
    for (std::int64_t time_ns = (from_ns + kTickNs - 1) / kTickNs * kTickNs; time_ns < until_ns; time_ns += kTickNs) {
        const Pose device = simulation.scripted_input(time_ns).device;
        ToolSample sample;
        sample.time_s = seconds(time_ns);
        sample.hip = workspace.to_scene(device.position);
        for (std::size_t i = 0; i < frame.proxy_count; ++i) {
            const ProxyContact& particle = frame.proxies[i];
            if (holds && particle.in_contact == 0) {
                continue;
            }
            const Vec3 goal = device.position + device.orientation * vec3(particle.rest_offset);
            const Vec3 held =
                holds ? vec3(particle.position) : held_at(particle, goal, seconds(time_ns - frame.plane_time_ns));
            if (held == goal) {
                continue;
            }
            const Vec3 at = workspace.to_scene(goal);
            const Vec3 apart = workspace.to_scene(held) - at;
            sample.force += coupling.stiffness * part * apart;
            sample.torque += turning * part * glm::cross(at - sample.hip, apart);
            ++sample.collided;
        }
        samples.push_back(sample);
    }
}

ToolPicture tool_picture(const SceneRun& run, const std::string& title, ToolLook look) {
    const ToolProxies& tool = run.simulation().tool();
    ToolPicture picture;
    picture.scene = run.picture(title);
    picture.scene.proxy_radius = 0.0;
    picture.tool = tool.vertices();
    picture.device = tool.goal_vertices();
    PictureObject skin{
        .vertices = picture.tool, .triangles = tool.mesh().triangles, .closed = true, .colour = kSkinColour};
    skin.ghost = look == ToolLook::Spheres;
    picture.scene.objects.push_back(std::move(skin));
    if (look == ToolLook::Spheres) {
        for (const ToolParticle& p : tool.particles()) {
            picture.scene.spheres.push_back({p.position, p.radius, p.in_contact()});
        }
    } else if (run.result().in_contact) {
        picture.scene.objects.push_back(
            {.vertices = picture.device, .triangles = tool.mesh().triangles, .closed = true, .ghost = true});
    }
    return picture;
}

}  // namespace haptic::sim::reproduce
