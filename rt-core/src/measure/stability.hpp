// Stability trial: does a grip that is pressed against a virtual wall come to rest? Runs the whole tick against the
// emulated board and its mechanics, over real rings, in lockstep.
//
// The wall is a static plane; what is delayed is the reply to the grip. A contact frame rendered at time t replies to
// the device state of t - delay, in one of three ways:
//     Planes   The plane itself. A static plane does not depend on the pose, so this scheme, which rt-core uses, is
//              insensitive to the delay; only the sampled spring can vibrate.
//     Contact  The plane only if the delayed pose was inside it: late contact flags, as when proxies and flags are
//              synchronised (thesis, section 5.4.1). The wall is missing on entry and persists on exit.
//     Force    The delayed depth: at each tick the plane lies as far in front of the grip as the wall did then. The
//              whole force is late, as in a single-rate simulation. The strictest case: passive up to
//              K = 2 b / (T + 2 delay).
//
// A vibration grows if it ends larger than it began, or if it is sustained by energy that was never put in:
//     fault, or last > 0.2 mm and (last > first, or last > first / 2 and observer < -1e-4 J)
// `first` and `last` are the peak-to-peak amplitudes of the grip in windows of 0.4 s, one after the hand has arrived
// and one at the end, with the linear trend removed. `fault` is a fault of the tick, such as a string faster than 2
// m/s.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "haptic/device/grip_mechanics.hpp"
#include "tick/tick.hpp"

namespace haptic::rt {

/// The part of the reply that is delayed.
enum class DelayedPart : std::uint8_t { Planes, Contact, Force };
inline constexpr std::array<DelayedPart, 3> kDelayedParts = {DelayedPart::Planes, DelayedPart::Contact,
                                                             DelayedPart::Force};
[[nodiscard]] std::string_view name_of(DelayedPart late) noexcept;

/// The least damped mechanics that the passivity controller is designed for: 0.1 kg and 0.3 N s/m as the controller
/// assumes, no friction, no motor drag, and a hand that is a pure spring. A vibration loses energy only in the grip's
/// 0.3 N s/m.
[[nodiscard]] device::GripMechanics undamped_mechanics();

struct StabilityTrial {
    DelayedPart late = DelayedPart::Planes;
    double stiffness = 500.0;   // N/m
    std::int64_t delay_ns = 0;  // a multiple of the period
    double duration_s = 2.5;    // s, after the hand's motion of 12 mm in 0.1 s; at least 1
    TickSettings tick;
    device::GripMechanics mechanics = undamped_mechanics();
};

struct StabilityOutcome {
    double first_amplitude = 0.0;  // m, peak to peak
    double last_amplitude = 0.0;   // m, peak to peak
    double min_energy = 0.0;       // J, of the passivity observer
    double peak_force = 0.0;       // N, rendered
    double controlled = 0.0;       // fraction of ticks in which the passivity controller acted
    std::uint32_t faults = 0;      // HAPTIC_FAULT_*
    bool grows = false;
};

/// Runs one trial. Throws std::invalid_argument for a delay that is no multiple of the period or a duration below 1 s,
/// std::runtime_error if the tick does not reach Running, RingError.
[[nodiscard]] StabilityOutcome run_stability_trial(const StabilityTrial& trial);

}  // namespace haptic::rt
