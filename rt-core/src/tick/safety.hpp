// Safety machine: decides which tension and wrench the motors may carry in each state, and reacts to faults.
//
//             arm()            ramp done           held still            stop() or a fault
//   Disarmed ------> Tensioning ------> Calibrating ------> Running --------------------.
//       ^                 |                  |                                          v
//       |                 '------------------'----- stop() or a fault -----------> Faulted
//       '------------------------- force faded, then tension ---------------------------'
//
// Disarmed: motors at zero. Tensioning: tension ramps up to the minimum. Calibrating: minimum tension until the grip
// has been held still for a while; the strings then have their rest lengths. Running: the wrench is rendered. Faulted:
// the last wrench fades out smoothly, then the tension. Faults stay latched through Disarmed until the next arm().
#pragma once

#include <cstdint>

#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic::rt {

enum class SafetyState : std::uint8_t {
    Disarmed = HAPTIC_DISARMED,
    Tensioning = HAPTIC_TENSIONING,
    Calibrating = HAPTIC_CALIBRATING,
    Running = HAPTIC_RUNNING,
    Faulted = HAPTIC_FAULTED
};

struct SafetySettings {
    std::int64_t tension_ramp_ns = 500'000'000;      // ns, from zero tension to the minimum, and back
    std::int64_t calibration_hold_ns = 200'000'000;  // ns, for which the grip must be held still
    double calibration_movement = 0.5e-3;            // m, that a string may move in that time
    std::int64_t fault_fade_ns = 100'000'000;        // ns, in which the wrench fades to zero on a fault
    double residual = 1e-3;   // m, rms of measured minus explained lengths; one string off by 7 mm gives this (X3R)
    int residual_ticks = 20;  // consecutive ticks with a large residual or undetermined pose until a fault
    int exchange_ticks = 5;   // consecutive ticks with a failed exchange until a fault
    int overrun_ticks = 100;  // consecutive late ticks until a fault
};

/// ns, from arm() to Running if the grip is held still.
[[nodiscard]] std::int64_t arming_time_ns(const SafetySettings& settings) noexcept;

/// Findings of one tick.
struct TickHealth {
    std::int64_t elapsed_ns = 0;  // since the last tick
    bool exchange_ok = true;
    bool jump = false;
    bool late = false;
    bool finite = true;
    bool determined = true;         // the strings determine the pose
    bool slack = false;             // all suspects read longer than the others explain
    std::uint8_t suspects = 0;      // bit i: string i may be faulty; 0 while the lengths agree
    bool overheated = false;        // some motor, by the thermal model
    double residual = 0.0;          // m
    double largest_movement = 0.0;  // m, of a string since the last Calibration::Restart
};

class SafetyMachine {
  public:
    explicit SafetyMachine(const SafetySettings& settings) : settings_(settings) {}

    /// From Disarmed to Tensioning, clearing the faults. Ignored in other states.
    void arm() HAPTIC_RT;
    /// Orderly stop: handled like a fault, with the bit HAPTIC_FAULT_STOP.
    void stop() HAPTIC_RT;

    /// Raises HAPTIC_FAULT_NONFINITE, for a caller that found and removed such a value.
    void fault_nonfinite() HAPTIC_RT { fault(HAPTIC_FAULT_NONFINITE); }
    /// Disarms at once, without a fade, in any state: the motors are already at zero. The bits stay latched.
    void cut(std::uint32_t bits) HAPTIC_RT;

    /// Action that the caller takes on its encoders after update().
    enum class Calibration : std::uint8_t { None, Restart, Take };

    /// Advances by one tick. Restart: the grip moved, or calibration begins; measure movement from here. Take: the grip
    /// was held still; set the rest lengths.
    Calibration update(const TickHealth& health) HAPTIC_RT;

    [[nodiscard]] SafetyState state() const HAPTIC_RT { return state_; }
    /// Bits HAPTIC_FAULT_*, latched.
    [[nodiscard]] std::uint32_t faults() const HAPTIC_RT { return faults_; }

    /// Bit i: string i is a suspect of the fault SLACK or RESIDUAL; latched like faults().
    [[nodiscard]] std::uint8_t suspects() const HAPTIC_RT { return suspects_; }

    /// The permitted wrench: the wanted one while Running, the fading last one while Faulted, else zero. A wrench that
    /// is not finite is a fault, and the last good one begins to fade.
    Wrench permitted_wrench(const Wrench& wanted) HAPTIC_RT;
    /// Takes the wrench after the limits. A fault fades from it, and the tension stays until it is zero.
    void set_rendered(const Wrench& wrench) HAPTIC_RT;
    /// Factor on all tensions, 0..1; smooth in time.
    [[nodiscard]] double tension_scale() const HAPTIC_RT;

  private:
    void fault(std::uint32_t bits) HAPTIC_RT;
    void check_faults(const TickHealth& health) HAPTIC_RT;
    void advance_ramps(std::int64_t elapsed_ns) HAPTIC_RT;
    Calibration calibrate(const TickHealth& health) HAPTIC_RT;

    SafetySettings settings_;
    SafetyState state_ = SafetyState::Disarmed;
    std::uint32_t faults_ = 0;
    std::uint8_t suspects_ = 0;
    int failed_exchanges_ = 0;
    int large_residuals_ = 0;
    int late_ticks_ = 0;
    std::int64_t still_ns_ = 0;
    double tension_ = 0.0;      // 0..1, linear in time
    double wrench_fade_ = 0.0;  // 1..0 while faulted, linear in time
    Wrench last_wrench_;
    bool rendered_ = false;  // the wrench after the limits is not zero
};

}  // namespace haptic::rt
