#include "reproduce/haptic_render.hpp"

#include <stdexcept>
#include <string>

namespace haptic::sim::reproduce {
namespace {

constexpr std::int64_t kTickNs = 1'000'000;

}  // namespace

void HapticLoop::render(const Simulation& simulation, const ContactFrame& frame, std::int64_t from_ns,
                        std::int64_t until_ns, std::vector<HapticSample>& samples) {
    renderer_.inbox() = frame;
    if (const FrameDefect defect = renderer_.accept(from_ns); defect != FrameDefect::None) {
        throw std::logic_error("a frame of the simulation has a defect: " + std::string(describe(defect)));
    }
    const Workspace& workspace = simulation.workspace();
    const WorkspaceSettings& mapping = workspace.settings();
    const Quat scene_from_device = glm::conjugate(mapping.rotation);
    // Ticks at whole milliseconds, whatever the step of the simulation.
    for (std::int64_t time_ns = (from_ns + kTickNs - 1) / kTickNs * kTickNs; time_ns < until_ns; time_ns += kTickNs) {
        const Pose device = simulation.scripted_input(time_ns).device;
        const Contact contact = renderer_.render(device, time_ns, kTickNs).contact;
        // Inverse of the mapping to the hand: forces by the force scale, lever arms by the scale.
        HapticSample sample;
        sample.time_s = seconds(time_ns);
        sample.hip = workspace.to_scene(device.position);
        sample.proxy = workspace.to_scene(contact.proxy);
        sample.force = scene_from_device * contact.wrench.force / mapping.force_scale;
        sample.torque = scene_from_device * contact.wrench.torque / (mapping.force_scale * mapping.scale);
        sample.collided = contact.in_contact;
        samples.push_back(sample);
    }
}

}  // namespace haptic::sim::reproduce
