#include "rendering/overlay.hpp"

#include <algorithm>

#include "haptic/numeric.hpp"

namespace haptic::rt {
namespace {

WrenchLimits limits_of(const OverlaySettings& settings) {
    const double ramp_s = seconds(settings.ramp_ns);
    return {.force = settings.max_force,
            .torque = settings.max_torque,
            .force_rate = settings.max_force / ramp_s,
            .torque_rate = settings.max_torque / ramp_s};
}

}  // namespace

Overlay::Overlay(const OverlaySettings& settings) : timeout_ns_(settings.timeout_ns), limiter_(limits_of(settings)) {}

bool Overlay::accept(const WrenchOverlay& received, std::int64_t now_ns) HAPTIC_RT {
    const Wrench wrench = {to_vec3(received.force), to_vec3(received.torque)};
    if (!is_finite(wrench) || received.arrival_time_ns > now_ns + timeout_ns_) {
        return false;
    }
    // No time ahead of this tick: it would grow old later than the sender fell silent.
    newest_ = wrench;
    arrival_ns_ = std::min(received.arrival_time_ns, now_ns);
    return true;
}

Wrench Overlay::render(std::int64_t now_ns, std::int64_t elapsed_ns) HAPTIC_RT {
    const bool current = arrival_ns_ >= now_ns - timeout_ns_;
    return limiter_.apply(current ? newest_ : Wrench{}, elapsed_ns).wrench;
}

void Overlay::reset() HAPTIC_RT {
    newest_ = Wrench{};
    arrival_ns_ = 0;
    limiter_.reset();
}

}  // namespace haptic::rt
