#include "app/frame_outlet.hpp"

#include <algorithm>

#include <haptic/types.hpp>

namespace haptic::sim {

std::uint64_t FrameOutlet::publish(const ContactFrame& frame, std::int64_t publish_ns, std::int64_t now_ns) {
    frame_ = frame;
    frame_.publish_time_ns = publish_ns;
    felt_ = 1.0;
    last_ns_ = now_ns;
    return ring_.publish(frame_, now_ns);
}

std::uint64_t FrameOutlet::stand(std::int64_t now_ns) {
    if (last_ns_ == 0) {
        beat(now_ns);
        return 0;
    }
    ContactFrame frame = frame_;
    felt_ = std::max(0.0, felt_ - seconds(now_ns - last_ns_) / kFade);
    last_ns_ = now_ns;
    frame.stiffness *= felt_;
    frame.torque_stiffness *= felt_;
    frame.damping *= felt_;
    frame.flags |= faded() ? std::uint32_t{HAPTIC_FRAME_CLUTCHED} : 0u;
    frame.plane_time_ns = now_ns;
    frame.publish_time_ns = now_ns;
    frame.step_ns = kStandNs;
    for (std::uint32_t i = 0; i < frame.proxy_count; ++i) {
        ProxyContact& proxy = frame.proxies[i];
        store(Vec3(0.0), proxy.surface_velocity);
        for (std::uint32_t p = 0; p < proxy.plane_count; ++p) {
            proxy.planes[p].velocity = 0.0;
        }
    }
    return ring_.publish(frame, now_ns);
}

}  // namespace haptic::sim
