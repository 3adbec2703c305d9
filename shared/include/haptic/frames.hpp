// Ring slots for C++: type names, layout assertions, and the validation of a received contact frame.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "haptic/frames.h"
#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic {

using ContactPlane = haptic_plane;
using ProxyContact = haptic_proxy;
using ContactFrame = haptic_contact_frame;
using DeviceState = haptic_device_state;
using WrenchOverlay = haptic_wrench_overlay;

inline constexpr std::size_t kMaxProxies = HAPTIC_MAX_PROXIES;
inline constexpr std::size_t kMaxPlanes = HAPTIC_MAX_PLANES;
inline constexpr std::size_t kStrings = HAPTIC_STRINGS;
inline constexpr std::size_t kMaxComplianceRows = HAPTIC_MAX_COMPLIANCE_ROWS;
inline constexpr std::size_t kMaxCompliances = HAPTIC_MAX_COMPLIANCES;
/// Largest radius of a proxy, m: far beyond what any device reaches.
inline constexpr double kMaxProxyRadius = 10.0;

static_assert(std::is_trivially_copyable_v<ContactFrame> && std::is_trivially_copyable_v<DeviceState> &&
              std::is_trivially_copyable_v<WrenchOverlay>);
static_assert(sizeof(ContactPlane) == 40 && sizeof(ProxyContact) == 232 && offsetof(ProxyContact, position) == 56);
static_assert(sizeof(ContactFrame) == 112 + 64 * 232 + kMaxCompliances * 4 && offsetof(ContactFrame, proxies) == 112);
static_assert(sizeof(DeviceState) == 32 + 38 * 8 + 16 && offsetof(DeviceState, safety_state) == 336);
static_assert(sizeof(WrenchOverlay) == 72 && offsetof(WrenchOverlay, force) == 24);

/// Why a contact frame must not be rendered.
enum class FrameDefect : std::uint8_t {
    None,
    ProxyCount,  // more than kMaxProxies
    PlaneCount,  // more than kMaxPlanes
    NonFinite,   // a number that is used is not finite
    Normal,      // a normal's length differs from 1 by more than 1e-6
    Coupling,    // a stiffness or friction is negative
    Step,        // step_ns is not positive, or longer than a second
    Rows,        // compliance_rows is neither 0 nor the number that planes and HAPTIC_PROXY_TANGENTS imply
    Compliance,  // no compliance: a diagonal element too small, or another one larger than its diagonal allows
    Reserved,    // a reserved field is not 0
    Radius       // a proxy's radius is negative, or larger than kMaxProxyRadius
};
/// The enumerator with the largest value.
inline constexpr FrameDefect kLastFrameDefect = FrameDefect::Radius;

/// Rows of the contact problem (contact_problem.hpp) of a proxy: its planes, and two tangents if it has any.
inline std::size_t contact_rows(const ProxyContact& proxy) HAPTIC_RT {
    return proxy.plane_count + ((proxy.in_contact & HAPTIC_PROXY_TANGENTS) != 0 ? 2u : 0u);
}
/// Index in ContactFrame::compliance of row r and column s <= r.
constexpr std::size_t compliance_index(std::size_t r, std::size_t s) noexcept {
    return r * (r + 1) / 2 + s;
}

/// The frame says how much work its surfaces have done.
inline bool reports_work(const ContactFrame& frame) HAPTIC_RT {
    return frame.body_work != 0.0;
}

/// Validates every field that a renderer uses. Bounded by kMaxProxies * kMaxPlanes and kMaxCompliances.
[[nodiscard]] FrameDefect find_defect(const ContactFrame& frame) HAPTIC_RT;

/// Describes a defect for reports; not for the tick.
[[nodiscard]] std::string_view describe(FrameDefect defect) noexcept;

/// Names of the codes and bits of a device state, for reports and views; not for the tick. Bits without a HAPTIC_*
/// constant are omitted; an undefined state is "unknown".
[[nodiscard]] std::string_view safety_state_name(std::uint32_t safety_state) noexcept;
[[nodiscard]] std::vector<std::string> fault_names(std::uint32_t faults);
[[nodiscard]] std::vector<std::string> tick_flag_names(std::uint32_t tick_flags);

inline Vec3 to_vec3(const double (&v)[3]) HAPTIC_RT {
    return {v[0], v[1], v[2]};
}
inline Quat to_quat(const double (&q)[4]) HAPTIC_RT {
    return Quat(q[0], q[1], q[2], q[3]);
}
inline void store(const Vec3& from, double (&to)[3]) HAPTIC_RT {
    to[0] = from.x;
    to[1] = from.y;
    to[2] = from.z;
}
inline void store(const Quat& from, double (&to)[4]) HAPTIC_RT {
    to[0] = from.w;
    to[1] = from.x;
    to[2] = from.y;
    to[3] = from.z;
}

/// Pose of a device state.
inline Pose pose_of(const DeviceState& state) HAPTIC_RT {
    return {to_vec3(state.position), to_quat(state.orientation)};
}

}  // namespace haptic
