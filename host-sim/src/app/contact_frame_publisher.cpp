#include "app/contact_frame_publisher.hpp"

#include <algorithm>

#include "haptic/types.hpp"

namespace haptic::sim {

std::uint64_t ContactFramePublisher::publish(const ContactFrame& frame, std::int64_t publish_ns, std::int64_t now_ns) {
    frame_ = frame;
    frame_.publish_time_ns = publish_ns;
    gain_ = 1.0;
    last_ns_ = now_ns;
    return ring_.publish(frame_, now_ns);
}

std::uint64_t ContactFramePublisher::publish_idle(std::int64_t now_ns) {
    if (last_ns_ == 0) {
        beat(now_ns);
        return 0;
    }
    // Fade the coupling; once it is gone, say so by the clutch flag.
    ContactFrame frame = frame_;
    gain_ = std::max(0.0, gain_ - seconds(now_ns - last_ns_) / kFade);
    last_ns_ = now_ns;
    frame.stiffness *= gain_;
    frame.torque_stiffness *= gain_;
    frame.flags |= faded() ? std::uint32_t{HAPTIC_FRAME_CLUTCHED} : 0u;
    // Planes and fingers at rest, as of now.
    frame.plane_time_ns = now_ns;
    frame.publish_time_ns = now_ns;
    frame.step_ns = kIdlePeriodNs;
    for (std::uint32_t i = 0; i < frame.proxy_count; ++i) {
        ProxyContact& proxy = frame.proxies[i];
        store(Vec3(0.0), proxy.rest_velocity);
        store(Vec3(0.0), proxy.surface_velocity);
        for (std::uint32_t p = 0; p < proxy.plane_count; ++p) {
            proxy.planes[p].velocity = 0.0;
        }
    }
    return ring_.publish(frame, now_ns);
}

}  // namespace haptic::sim
