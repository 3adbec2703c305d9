#include "haptic/frames.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

#include "haptic/numeric.hpp"

namespace haptic {
namespace {

// W_rs over sqrt(W_rr W_ss) that is rounding: the elements are floats.
constexpr float kComplianceTolerance = 1.000005F;
// Square root of the largest float, less what the tolerance adds.
constexpr float kLargestRoot = 1.8446e19F;

using BitName = std::pair<std::uint32_t, const char*>;

constexpr std::array<BitName, 13> kFaultNames = {{
    {HAPTIC_FAULT_EXCHANGE, "exchange"},
    {HAPTIC_FAULT_JUMP, "encoder_jump"},
    {HAPTIC_FAULT_SLACK, "slack"},
    {HAPTIC_FAULT_RESIDUAL, "residual"},
    {HAPTIC_FAULT_OVERRUN, "overrun"},
    {HAPTIC_FAULT_NONFINITE, "nonfinite"},
    {HAPTIC_FAULT_STOP, "stop"},
    {HAPTIC_FAULT_THERMAL, "thermal"},
    {HAPTIC_FAULT_WATCHDOG, "watchdog"},
    {HAPTIC_FAULT_WIRING, "wiring"},
    {HAPTIC_FAULT_POSE, "pose"},
    {HAPTIC_FAULT_BUDGET, "budget"},
    {HAPTIC_FAULT_GUARD, "guard"},
}};

constexpr std::array<BitName, 17> kTickFlagNames = {{
    {HAPTIC_TICK_OVERRUN, "overrun"},
    {HAPTIC_TICK_FRAME_STALE, "frame_stale"},
    {HAPTIC_TICK_FRAME_REJECTED, "frame_rejected"},
    {HAPTIC_TICK_FORCE_LIMITED, "force_limited"},
    {HAPTIC_TICK_SLEW_LIMITED, "slew_limited"},
    {HAPTIC_TICK_WRENCH_UNREACHABLE, "wrench_unreachable"},
    {HAPTIC_TICK_EXCHANGE_FAILED, "exchange_failed"},
    {HAPTIC_TICK_DERATED, "derated"},
    {HAPTIC_TICK_STIFFNESS_LIMITED, "stiffness_limited"},
    {HAPTIC_TICK_PASSIVITY_LIMITED, "passivity_limited"},
    {HAPTIC_TICK_PROBE_OFF, "probe_off"},
    {HAPTIC_TICK_UNPROVEN, "unproven"},
    {HAPTIC_TICK_COMMISSIONING, "commissioning"},
    {HAPTIC_TICK_WORKSPACE_EDGE, "workspace_edge"},
    {HAPTIC_TICK_ARM_AWAITED, "arm_awaited"},
    {HAPTIC_TICK_BUDGET_LOW, "budget_low"},
    {HAPTIC_TICK_OVERLAY, "overlay"},
}};

template <std::size_t N>
std::vector<std::string> names_of(std::uint32_t bits, const std::array<BitName, N>& names) {
    std::vector<std::string> found;
    for (const auto& [bit, name] : names) {
        if ((bits & bit) != 0) {
            found.emplace_back(name);
        }
    }
    return found;
}

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
    if (!all_finite(proxy.rest_offset) || !all_finite(proxy.rest_velocity) || !all_finite(proxy.position) ||
        !all_finite(proxy.surface_velocity) || !std::isfinite(proxy.radius)) {
        return FrameDefect::NonFinite;
    }
    if (proxy.radius < 0.0 || proxy.radius > kMaxProxyRadius) {
        return FrameDefect::Radius;
    }
    for (std::uint32_t i = 0; i < proxy.plane_count; ++i) {
        if (const FrameDefect defect = find_defect(proxy.planes[i]); defect != FrameDefect::None) {
            return defect;
        }
    }
    return FrameDefect::None;
}

/// Row by row: the diagonal is a compliance, and |W_rs| <= sqrt(W_rr W_ss), without which no energy has this matrix.
FrameDefect find_compliance_defect(const ContactFrame& frame) HAPTIC_RT {
    std::size_t rows = 0;
    std::array<float, kMaxComplianceRows> roots{};  // of the diagonal
    for (std::uint32_t i = 0; i < frame.proxy_count; ++i) {
        const ProxyContact& proxy = frame.proxies[i];
        const std::size_t end = rows + contact_rows(proxy);
        // Tangents need a plane to be tangential to.
        if (end > frame.compliance_rows || (end > rows && proxy.plane_count == 0)) {
            return FrameDefect::Rows;
        }
        for (std::size_t r = rows; r < end; ++r) {
            // A normal row yields to a force; tangential rows may be rigid.
            const double diagonal = frame.compliance[compliance_index(r, r)];
            if (!std::isfinite(diagonal)) {
                return FrameDefect::NonFinite;
            }
            if (diagonal < 0.0 || (diagonal == 0.0 && r < rows + proxy.plane_count)) {
                return FrameDefect::Compliance;
            }
            // In single precision and counted, so that compilers vectorise the loop. A NaN fails the comparison too,
            // and no product of two roots is infinite.
            roots[r] = std::min(static_cast<float>(std::sqrt(diagonal)), kLargestRoot);
            const float* const row = &frame.compliance[compliance_index(r, 0)];
            const float limit = roots[r] * kComplianceTolerance;
            std::int32_t beyond = 0;
            for (std::size_t s = 0; s < r; ++s) {
                beyond += std::abs(row[s]) <= limit * roots[s] ? 0 : 1;
            }
            if (beyond > 0) {
                return FrameDefect::Compliance;
            }
        }
        rows = end;
    }
    return rows == frame.compliance_rows ? FrameDefect::None : FrameDefect::Rows;
}

}  // namespace

FrameDefect find_defect(const ContactFrame& frame) HAPTIC_RT {
    if (frame.proxy_count > kMaxProxies) {
        return FrameDefect::ProxyCount;
    }
    if (frame.compliance_rows > kMaxComplianceRows) {
        return FrameDefect::Rows;
    }
    if (frame.reserved != 0) {
        return FrameDefect::Reserved;
    }
    // Coupling: finite and not negative.
    const double coupling[] = {frame.stiffness, frame.torque_stiffness, frame.static_friction, frame.dynamic_friction};
    if (!all_finite(coupling) || !std::isfinite(frame.body_work)) {
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
    // Proxies and their planes.
    for (std::uint32_t i = 0; i < frame.proxy_count; ++i) {
        if (const FrameDefect defect = find_defect(frame.proxies[i]); defect != FrameDefect::None) {
            return defect;
        }
    }
    return frame.compliance_rows > 0 ? find_compliance_defect(frame) : FrameDefect::None;
}

std::string_view describe(FrameDefect defect) noexcept {
    switch (defect) {
        case FrameDefect::None:
            return "the frame is valid";
        case FrameDefect::ProxyCount:
            return "more proxies than HAPTIC_MAX_PROXIES";
        case FrameDefect::PlaneCount:
            return "a proxy has more planes than HAPTIC_MAX_PLANES";
        case FrameDefect::NonFinite:
            return "a number is not finite";
        case FrameDefect::Normal:
            return "a plane's normal is not of unit length";
        case FrameDefect::Coupling:
            return "a stiffness or friction is negative";
        case FrameDefect::Step:
            return "step_ns is not between 1 ns and 1 s";
        case FrameDefect::Rows:
            return "compliance_rows is neither 0 nor the number of planes and tangents";
        case FrameDefect::Compliance:
            return "the compliance is not that of an elastic tool";
        case FrameDefect::Reserved:
            return "a reserved field is not 0";
        case FrameDefect::Radius:
            return "a proxy's radius is not between 0 and 10 m";
    }
    return "unknown defect";
}

std::string_view safety_state_name(std::uint32_t safety_state) noexcept {
    switch (safety_state) {
        case HAPTIC_DISARMED:
            return "disarmed";
        case HAPTIC_TENSIONING:
            return "tensioning";
        case HAPTIC_CALIBRATING:
            return "calibrating";
        case HAPTIC_RUNNING:
            return "running";
        case HAPTIC_FAULTED:
            return "faulted";
        case HAPTIC_PROVING:
            return "proving";
        default:
            return "unknown";
    }
}

std::vector<std::string> fault_names(std::uint32_t faults) {
    return names_of(faults, kFaultNames);
}

std::vector<std::string> tick_flag_names(std::uint32_t tick_flags) {
    std::vector<std::string> names = names_of(tick_flags, kTickFlagNames);
    for (std::uint32_t string = 0; string < kStrings; ++string) {
        if ((tick_flags >> (HAPTIC_TICK_SUSPECTS_SHIFT + string) & 1u) != 0) {
            names.push_back("suspect_string_" + std::to_string(string));
        }
    }
    return names;
}

}  // namespace haptic
