#include "reproduce/haptic_render.hpp"

#include <stdexcept>
#include <string>

namespace haptic::sim::reproduce {

void HapticLoop::accept(const ContactFrame& frame, std::int64_t now_ns) {
    if (const FrameDefect defect = renderer_.accept(frame, now_ns); defect != FrameDefect::None) {
        throw std::logic_error("a frame of the simulation has a defect: " + std::string(describe(defect)));
    }
}

HapticSample HapticLoop::tick(const Workspace& workspace, const Pose& device, std::int64_t time_ns) {
    const Contact contact = renderer_.render(device, time_ns, kTickNs).contact;
    HapticSample sample;
    sample.time_s = seconds(time_ns);
    sample.hip = workspace.to_scene(device.position);
    sample.proxy = workspace.to_scene(contact.proxy);
    sample.force = workspace.force_to_scene(contact.wrench.force);
    sample.torque = workspace.force_to_scene(contact.wrench.torque) / workspace.settings().scale;
    sample.collided = contact.in_contact;
    return sample;
}

void HapticLoop::render(const Simulation& simulation, const ContactFrame& frame, std::int64_t from_ns,
                        std::int64_t until_ns, std::vector<HapticSample>& samples) {
    accept(frame, from_ns);
    // Ticks at whole milliseconds, whatever the step of the simulation.
    for (std::int64_t time_ns = (from_ns + kTickNs - 1) / kTickNs * kTickNs; time_ns < until_ns; time_ns += kTickNs) {
        samples.push_back(tick(simulation.workspace(), simulation.scripted_input(time_ns).device, time_ns));
    }
}

}  // namespace haptic::sim::reproduce
