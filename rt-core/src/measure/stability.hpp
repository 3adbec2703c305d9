// Whether a grip that is pressed against a virtual wall comes to rest: the whole tick against the emulated board and
// its mechanics, over real rings, in lockstep.
//
// The wall is a resting plane; what is late is the answer to the grip. A frame that is rendered at t answers the device
// state of t - delay:
//     Planes   the plane itself. A resting plane is the same however old the pose is, so that this scheme, the one of
//              rt-core, does not feel the delay; only the sampled spring is left to vibrate.
//     Contact  the plane only if the pose of then was in it: contact flags that come late, as when proxies and flags
//     are
//              synchronised (thesis, section 5.4.1). The wall stays out when entered and in when left.
//     Force    the depth of then: at each tick the plane lies as far before the grip as the wall was then. The whole
//              force is late, as in a single-rate simulation. The strictest: passive up to K = 2 b / (T + 2 delay).
//
// A vibration grows if it ends larger than it began, or is kept up with energy that never came in:
//     fault, or last > 0.2 mm and (last > first, or last > first / 2 and observer < -1e-4 J)
// with first and last the way of the grip from lowest to highest in 0.4 s, off the line that fits it best, once the
// hand has arrived and at the end. A fault is one of the tick's own: a string that is thrown faster than 2 m/s.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include <haptic/device/grip_mechanics.hpp>
#include "tick/tick.hpp"

namespace haptic::rt {

enum class LateAnswer : std::uint8_t { Planes, Contact, Force };
inline constexpr std::array<LateAnswer, 3> kLateAnswers = {LateAnswer::Planes, LateAnswer::Contact, LateAnswer::Force};
[[nodiscard]] std::string_view name_of(LateAnswer late) noexcept;

/// 0.1 kg and 0.3 N s/m as the passivity controller has them, no friction, motors without drag, and a hand that is a
/// spring without damping: whatever the vibration loses, it loses in the grip's 0.3 N s/m.
[[nodiscard]] device::GripMechanics undamped_hand();

struct StabilityTrial {
    LateAnswer late = LateAnswer::Planes;
    double stiffness = 500.0;   // N/m
    std::int64_t delay_ns = 0;  // a multiple of the period
    double duration_s = 2.5;    // s, after the hand's way of 12 mm in 0.1 s; at least 1
    TickSettings tick;
    device::GripMechanics mechanics = undamped_hand();
};

struct StabilityOutcome {
    double first_amplitude = 0.0;  // m
    double last_amplitude = 0.0;   // m
    double least_energy = 0.0;     // J, of the passivity observer
    double peak_force = 0.0;       // N, rendered
    double controlled = 0.0;       // share of ticks at which the passivity controller acted
    std::uint32_t faults = 0;      // HAPTIC_FAULT_*
    bool grows = false;
};

/// Throws std::invalid_argument for a delay that is no multiple of the period, std::runtime_error if the tick does not
/// come to run, RingError.
[[nodiscard]] StabilityOutcome try_contact(const StabilityTrial& trial);

}  // namespace haptic::rt
