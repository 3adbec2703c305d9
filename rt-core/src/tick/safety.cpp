#include "tick/safety.hpp"

#include <algorithm>
#include <cmath>

#include "haptic/numeric.hpp"

namespace haptic::rt {
namespace {

std::uint32_t bit_if(bool condition, std::uint32_t bit) HAPTIC_RT {
    return condition ? bit : 0u;
}

/// Number of consecutive ticks up to now for which a condition held.
int count_consecutive(int so_far, bool now) HAPTIC_RT {
    return now ? so_far + 1 : 0;
}

}  // namespace

void SafetyMachine::arm() HAPTIC_RT {
    if (state_ != SafetyState::Disarmed) {
        return;
    }
    // Forget the last run: faults, counts of consecutive ticks, ramps and wrench.
    state_ = SafetyState::Tensioning;
    faults_ = 0;
    suspects_ = 0;
    failed_exchanges_ = 0;
    large_residuals_ = 0;
    late_ticks_ = 0;
    // Both ramps start at zero, and nothing is left to fade out.
    tension_ = 0.0;
    wrench_fade_ = 0.0;
    last_wrench_ = Wrench{};
    rendered_ = false;
}

void SafetyMachine::stop() HAPTIC_RT {
    fault(HAPTIC_FAULT_STOP);
}

void SafetyMachine::cut(std::uint32_t bits) HAPTIC_RT {
    faults_ |= bits;
    state_ = SafetyState::Disarmed;
    tension_ = 0.0;
    wrench_fade_ = 0.0;
}

void SafetyMachine::fault(std::uint32_t bits) HAPTIC_RT {
    if (state_ == SafetyState::Disarmed) {
        return;  // motors are at zero already
    }
    faults_ |= bits;
    if (state_ != SafetyState::Faulted) {
        state_ = SafetyState::Faulted;
        wrench_fade_ = 1.0;
    }
}

SafetyMachine::Calibration SafetyMachine::update(const TickHealth& health) HAPTIC_RT {
    // A fault found now starts to fade out in this same tick.
    check_faults(health);
    advance_ramps(health.elapsed_ns);
    // Strings at minimum tension: calibrate as soon as the grip is held still.
    if (state_ == SafetyState::Tensioning && tension_ >= 1.0) {
        state_ = SafetyState::Calibrating;
        still_ns_ = 0;
        return Calibration::Restart;
    }
    return state_ == SafetyState::Calibrating ? calibrate(health) : Calibration::None;
}

void SafetyMachine::check_faults(const TickHealth& health) HAPTIC_RT {
    // Conditions that are harmless for a few ticks.
    failed_exchanges_ = count_consecutive(failed_exchanges_, !health.exchange_ok);
    late_ticks_ = count_consecutive(late_ticks_, health.late);
    // Before calibration the lengths do not belong to a pose.
    const bool contradiction =
        state_ == SafetyState::Running && !(health.determined && health.residual <= settings_.residual);
    large_residuals_ = count_consecutive(large_residuals_, contradiction);

    // Each condition faults after its number of consecutive ticks; a jump, NaN or overheating at once.
    const std::uint32_t bits =
        bit_if(failed_exchanges_ > settings_.exchange_ticks, HAPTIC_FAULT_EXCHANGE) |
        bit_if(late_ticks_ > settings_.overrun_ticks, HAPTIC_FAULT_OVERRUN) |
        bit_if(large_residuals_ > settings_.residual_ticks, health.slack ? HAPTIC_FAULT_SLACK : HAPTIC_FAULT_RESIDUAL) |
        bit_if(health.jump, HAPTIC_FAULT_JUMP) | bit_if(!health.finite, HAPTIC_FAULT_NONFINITE) |
        bit_if(health.overheated, HAPTIC_FAULT_THERMAL);
    // Keep the strings that the residual points to.
    if ((bits & (HAPTIC_FAULT_SLACK | HAPTIC_FAULT_RESIDUAL)) != 0) {
        suspects_ = health.suspects;
    }
    if (bits != 0) {
        fault(bits);
    }
}

void SafetyMachine::advance_ramps(std::int64_t elapsed_ns) HAPTIC_RT {
    const double dt = static_cast<double>(elapsed_ns);
    // Share of the tension ramp that this tick covers; arming raises the tension, a fault lowers it last.
    const double tension_step = dt / static_cast<double>(settings_.tension_ramp_ns);
    if (state_ == SafetyState::Tensioning) {
        tension_ = std::min(1.0, tension_ + tension_step);
    } else if (state_ == SafetyState::Faulted) {
        // First the wrench, then the tension once the limiter has let the wrench reach zero.
        if (wrench_fade_ > 0.0) {
            wrench_fade_ = std::max(0.0, wrench_fade_ - dt / static_cast<double>(settings_.fault_fade_ns));
        } else if (!rendered_) {
            tension_ = std::max(0.0, tension_ - tension_step);
        }
        if (tension_ <= 0.0) {
            state_ = SafetyState::Disarmed;
        }
    }
}

SafetyMachine::Calibration SafetyMachine::calibrate(const TickHealth& health) HAPTIC_RT {
    // The grip moved, or the counters are not current: restart the hold.
    if (health.largest_movement > settings_.calibration_movement || !health.exchange_ok) {
        still_ns_ = 0;
        return Calibration::Restart;
    }
    // After the hold time the strings have their rest lengths.
    still_ns_ += health.elapsed_ns;
    if (still_ns_ < settings_.calibration_hold_ns) {
        return Calibration::None;
    }
    state_ = SafetyState::Running;
    return Calibration::Take;
}

Wrench SafetyMachine::permitted_wrench(const Wrench& wanted) HAPTIC_RT {
    // Running: pass the wrench. One that is not finite must never reach the motors.
    if (state_ == SafetyState::Running) {
        if (is_finite(wanted)) {
            last_wrench_ = wanted;
            return wanted;
        }
        fault(HAPTIC_FAULT_NONFINITE);
    }
    // Faulted: fade the last wrench out. In all other states there is none.
    if (state_ != SafetyState::Faulted) {
        return Wrench{};
    }
    const double factor = smooth_step(wrench_fade_);
    return {factor * last_wrench_.force, factor * last_wrench_.torque};
}

void SafetyMachine::set_rendered(const Wrench& wrench) HAPTIC_RT {
    if (state_ == SafetyState::Running) {
        last_wrench_ = wrench;
    }
    rendered_ = wrench.force != Vec3(0.0) || wrench.torque != Vec3(0.0);
}

double SafetyMachine::tension_scale() const HAPTIC_RT {
    return smooth_step(tension_);
}

std::int64_t arming_time_ns(const SafetySettings& settings) noexcept {
    return settings.tension_ramp_ns + settings.calibration_hold_ns;
}

}  // namespace haptic::rt
