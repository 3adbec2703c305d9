#include "tick/safety.hpp"

#include <algorithm>
#include <cmath>

#include "haptic/numeric.hpp"
#include "rendering/wrench_arithmetic.hpp"

namespace haptic::rt {
namespace {

std::uint32_t bit_if(bool condition, std::uint32_t bit) HAPTIC_RT {
    return condition ? bit : 0u;
}

// A ramp advances in real time, but by at most this share of its length per tick, so that no gap turns it into a step.
constexpr double kLongestRampStep = 0.2;

double ramp_step(std::int64_t elapsed_ns, std::int64_t ramp_ns) HAPTIC_RT {
    return std::min(kLongestRampStep, static_cast<double>(elapsed_ns) / static_cast<double>(ramp_ns));
}

}  // namespace

SafetyMachine::SafetyMachine(const SafetySettings& settings) HAPTIC_RT : settings_(settings),
                                                                         exchange_(settings.window_ns),
                                                                         late_(settings.late_window_ns),
                                                                         residual_(settings.window_ns) {}

void SafetyMachine::arm() HAPTIC_RT {
    if (state_ != SafetyState::Disarmed) {
        return;
    }
    // Forget the last run: faults, recent time, ramps and wrench.
    state_ = SafetyState::Tensioning;
    faults_ = 0;
    suspects_ = 0;
    exchange_.reset();
    late_.reset();
    residual_.reset();
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
    update_shares(health);
    check_faults(health);
    advance_ramps(health.elapsed_ns);
    switch (state_) {
        case SafetyState::Tensioning:
            if (tension_ < 1.0) {
                return Calibration::None;
            }
            if (!settings_.prove) {
                return begin_calibration();
            }
            state_ = SafetyState::Proving;
            return Calibration::None;
        case SafetyState::Proving:
            return health.wiring == Proof::Passed ? begin_calibration() : Calibration::None;
        case SafetyState::Calibrating:
            return calibrate(health);
        case SafetyState::Disarmed:
        case SafetyState::Running:
        case SafetyState::Faulted:
            break;
    }
    return Calibration::None;
}

void SafetyMachine::update_shares(const TickHealth& health) HAPTIC_RT {
    exchange_.update(health.exchange_ok ? 0 : health.elapsed_ns, health.elapsed_ns);
    late_.update(health.late_ns, health.elapsed_ns);
    // Before calibration the lengths do not belong to a pose.
    const bool contradiction =
        state_ == SafetyState::Running && !(health.determined && health.residual <= settings_.residual);
    residual_.update(contradiction ? health.elapsed_ns : 0, health.elapsed_ns);
}

void SafetyMachine::check_faults(const TickHealth& health) HAPTIC_RT {
    const bool unanswered =
        exchange_.value() > settings_.exchange_share || health.encoder_age_ns > settings_.encoder_age_ns;
    const bool contradicted = state_ == SafetyState::Running && residual_.value() > settings_.residual_share;
    const bool miswired = state_ == SafetyState::Proving && health.wiring == Proof::Refused;
    const bool displaced = state_ == SafetyState::Running && health.pose == Proof::Refused;
    // What took too much of the recent time; all else at once.
    const std::uint32_t bits = bit_if(unanswered, HAPTIC_FAULT_EXCHANGE) |
                               bit_if(late_.value() > settings_.late_share, HAPTIC_FAULT_OVERRUN) |
                               bit_if(contradicted, health.slack ? HAPTIC_FAULT_SLACK : HAPTIC_FAULT_RESIDUAL) |
                               bit_if(miswired, HAPTIC_FAULT_WIRING) | bit_if(displaced, HAPTIC_FAULT_POSE) |
                               bit_if(health.jump, HAPTIC_FAULT_JUMP) | bit_if(!health.finite, HAPTIC_FAULT_NONFINITE) |
                               bit_if(health.overheated, HAPTIC_FAULT_THERMAL);
    // Keep the strings that the finding points to.
    constexpr std::uint32_t names_strings =
        HAPTIC_FAULT_SLACK | HAPTIC_FAULT_RESIDUAL | HAPTIC_FAULT_WIRING | HAPTIC_FAULT_JUMP | HAPTIC_FAULT_POSE;
    if ((bits & names_strings) != 0) {
        const bool in_lengths = (bits & (HAPTIC_FAULT_SLACK | HAPTIC_FAULT_RESIDUAL | HAPTIC_FAULT_POSE)) != 0;
        suspects_ = in_lengths && health.mixed_up != 0 ? health.mixed_up : health.suspects;
    }
    if (bits != 0) {
        fault(bits);
    }
}

void SafetyMachine::advance_ramps(std::int64_t elapsed_ns) HAPTIC_RT {
    // Arming raises the tension, a fault lowers it last.
    const double tension_step = ramp_step(elapsed_ns, settings_.tension_ramp_ns);
    if (state_ == SafetyState::Tensioning) {
        tension_ = std::min(1.0, tension_ + tension_step);
    } else if (state_ == SafetyState::Faulted) {
        // First the wrench, then the tension once the limiter has let the wrench reach zero.
        if (wrench_fade_ > 0.0) {
            wrench_fade_ = std::max(0.0, wrench_fade_ - ramp_step(elapsed_ns, settings_.fault_fade_ns));
        } else if (!rendered_) {
            tension_ = std::max(0.0, tension_ - tension_step);
        }
        if (tension_ <= 0.0) {
            state_ = SafetyState::Disarmed;
        }
    }
}

SafetyMachine::Calibration SafetyMachine::begin_calibration() HAPTIC_RT {
    state_ = SafetyState::Calibrating;
    still_ns_ = 0;
    return Calibration::Restart;
}

SafetyMachine::Calibration SafetyMachine::calibrate(const TickHealth& health) HAPTIC_RT {
    // The grip moved, or the counters are not current: restart the hold.
    if (health.largest_movement > settings_.calibration_movement || !health.exchange_ok) {
        still_ns_ = 0;
        return Calibration::Restart;
    }
    // After the hold time the strings have their rest lengths. A gap proves little: the grip may have moved and
    // returned.
    still_ns_ += std::min(health.elapsed_ns, settings_.calibration_hold_ns / 5 + 1);
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
    return scaled(factor, last_wrench_);
}

void SafetyMachine::set_rendered(const Wrench& wrench) HAPTIC_RT {
    if (state_ == SafetyState::Running) {
        last_wrench_ = wrench;
    }
    rendered_ = !is_zero(wrench);
}

double SafetyMachine::tension_scale() const HAPTIC_RT {
    return smooth_step(tension_);
}

std::int64_t arming_time_ns(const SafetySettings& settings) noexcept {
    return settings.tension_ramp_ns + settings.calibration_hold_ns;
}

}  // namespace haptic::rt
