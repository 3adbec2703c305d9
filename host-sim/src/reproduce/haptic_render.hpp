// Haptic loop of the figures: force and torque at 1 kHz from the frames of a simulation, by the renderer that rt-core's
// ticks use, without encoders, strings, passivity controller and limits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "haptic/frames.hpp"
#include "haptic/sim/simulation.hpp"
#include "haptic/types.hpp"
#include "rendering/renderer.hpp"

namespace haptic::sim::reproduce {

/// One millisecond of haptic rendering, in the scene.
struct HapticSample {
    double time_s = 0.0;
    Vec3 hip{0.0};             // m, haptic interface point: where the device has the tool's origin
    Vec3 proxy{0.0};           // m, the first local proxy
    Vec3 force{0.0};           // N, on the hand
    Vec3 torque{0.0};          // N*m, on the hand, about the hip
    std::size_t collided = 0;  // proxies that are pushed
};

class HapticLoop {
  public:
    /// Takes a frame and renders it with the scripted hand at each whole millisecond in [from_ns, until_ns). To be
    /// called with adjoining intervals, from 0 on. Throws std::logic_error for a frame with a defect.
    void render(const Simulation& simulation, const ContactFrame& frame, std::int64_t from_ns, std::int64_t until_ns,
                std::vector<HapticSample>& samples);

    /// The parts of render(), for a hand that no script leads: a new frame, and one tick with the device at a pose.
    void accept(const ContactFrame& frame, std::int64_t now_ns);
    [[nodiscard]] HapticSample tick(const Workspace& workspace, const Pose& device, std::int64_t time_ns);

    static constexpr std::int64_t kTickNs = 1'000'000;

  private:
    FrameRenderer renderer_{FrameSettings{}};
};

}  // namespace haptic::sim::reproduce
