// A contact frame with one plane, and its contact, for tests.
#pragma once

#include <cstdint>
#include <memory>

#include "haptic/frames.hpp"
#include "haptic/types.hpp"
#include "rendering/loaded_tool.hpp"

namespace haptic::rt::test {

/// Frame with one particle above a horizontal plane: dot((0,1,0), x) >= height.
inline ContactFrame floor_frame(double height, double stiffness, std::int64_t now_ns) {
    ContactFrame frame{};
    frame.state_time_ns = now_ns;
    frame.plane_time_ns = now_ns;
    frame.publish_time_ns = now_ns;
    frame.step_ns = 10'000'000;
    frame.stiffness = stiffness;
    frame.proxy_count = 1;
    frame.proxies[0].plane_count = 1;
    frame.proxies[0].planes[0].normal[1] = 1.0;
    frame.proxies[0].planes[0].offset = height;
    return frame;
}

/// Contact of a frame at a pose, without a past.
inline Contact render_once(const ContactFrame& frame, const Pose& grip, std::int64_t time_ns = 0) {
    const auto tool = std::make_unique<haptic::test::LoadedTool>();
    tool->load(frame);
    return tool->render(frame.stiffness, {.pose = grip, .previous = grip}, time_ns);
}

}  // namespace haptic::rt::test
