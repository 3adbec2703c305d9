// Haptic rendering for the figures: the force and torque that a 1 kHz haptic loop computes from the frames of a
// simulation. rt-core computes the same, and adds limits, smoothing and damping.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "haptic/frames.hpp"
#include "haptic/sim/simulation.hpp"
#include "haptic/types.hpp"

namespace haptic::sim::reproduce {

/// One millisecond of haptic rendering, in the scene.
struct HapticSample {
    double time_s = 0.0;
    Vec3 hip{0.0};             // m, haptic interface point: where the device has the tool's origin
    Vec3 proxy{0.0};           // m, the first local proxy
    Vec3 force{0.0};           // N, on the hand
    Vec3 torque{0.0};          // N*m, on the hand, about the hip
    std::size_t collided = 0;  // proxies that contribute to them
};

/// Renders one contact frame with the scripted hand at each whole millisecond in [from_ns, until_ns).
///
/// The goal of proxy i of N is its rest position at the device's pose. Its local proxy is the point nearest to the goal
/// within its half-spaces, which move with their velocities; if the frame holds positions (thesis, section 5.4.1), it
/// is the position in the frame. With d_i from goal to local proxy and r_i from the hip to the goal, the force is
/// k sum d_i / N and the torque k_t sum r_i x d_i / N (thesis, section 5.2.2).
void render_haptics(const Simulation& simulation, const ContactFrame& frame, std::int64_t from_ns,
                    std::int64_t until_ns, std::vector<HapticSample>& samples);

}  // namespace haptic::sim::reproduce
