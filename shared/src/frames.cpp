#include "haptic/frames.hpp"

#include <cmath>

namespace haptic {
namespace {

constexpr double kUnitTolerance = 1e-6;

template <std::size_t N>
bool all_finite(const double (&values)[N]) HAPTIC_RT {
    bool finite = true;
    for (const double value : values) {
        finite = finite && std::isfinite(value);
    }
    return finite;
}

FrameDefect find_defect(const ContactPlane& plane) HAPTIC_RT {
    if (!all_finite(plane.normal) || !std::isfinite(plane.offset) || !std::isfinite(plane.velocity)) {
        return FrameDefect::NonFinite;
    }
    const Vec3 normal = to_vec3(plane.normal);
    const double length = std::sqrt(glm::dot(normal, normal));
    return std::abs(length - 1.0) <= kUnitTolerance ? FrameDefect::None : FrameDefect::Normal;
}

FrameDefect find_defect(const ProxyContact& proxy) HAPTIC_RT {
    if (proxy.plane_count > kMaxPlanes) {
        return FrameDefect::PlaneCount;
    }
    if (!all_finite(proxy.rest_offset) || !all_finite(proxy.position) || !all_finite(proxy.surface_velocity)) {
        return FrameDefect::NonFinite;
    }
    for (std::uint32_t i = 0; i < proxy.plane_count; ++i) {
        if (const FrameDefect defect = find_defect(proxy.planes[i]); defect != FrameDefect::None) {
            return defect;
        }
    }
    return FrameDefect::None;
}

}  // namespace

FrameDefect find_defect(const ContactFrame& frame) HAPTIC_RT {
    if (frame.proxy_count > kMaxProxies) {
        return FrameDefect::ProxyCount;
    }
    const double coupling[] = {frame.stiffness,          frame.torque_stiffness, frame.damping,
                               frame.rotational_damping, frame.static_friction,  frame.dynamic_friction};
    if (!all_finite(coupling)) {
        return FrameDefect::NonFinite;
    }
    for (const double value : coupling) {
        if (value < 0.0) {
            return FrameDefect::Coupling;
        }
    }
    if (frame.step_ns <= 0 || frame.step_ns > kNanosecondsPerSecond) {
        return FrameDefect::Step;
    }
    for (std::uint32_t i = 0; i < frame.proxy_count; ++i) {
        if (const FrameDefect defect = find_defect(frame.proxies[i]); defect != FrameDefect::None) {
            return defect;
        }
    }
    return FrameDefect::None;
}

std::string_view describe(FrameDefect defect) noexcept {
    switch (defect) {
        case FrameDefect::None:
            return "the frame is sound";
        case FrameDefect::ProxyCount:
            return "more proxies than HAPTIC_MAX_PROXIES";
        case FrameDefect::PlaneCount:
            return "a proxy has more planes than HAPTIC_MAX_PLANES";
        case FrameDefect::NonFinite:
            return "a number is not finite";
        case FrameDefect::Normal:
            return "a plane's normal is not of unit length";
        case FrameDefect::Coupling:
            return "a stiffness, damping or friction is negative";
        case FrameDefect::Step:
            return "step_ns is not within 1 ns and 1 s";
    }
    return "unknown defect";
}

}  // namespace haptic
