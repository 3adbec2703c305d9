// The safety machine: when motors may carry what, and what is done when something is wrong.
//
//             arm()            ramp done           held still            stop() or a fault
//   Disarmed ------> Tensioning ------> Calibrating ------> Running --------------------.
//       ^                 |                  |                                          v
//       |                 '------------------'----- stop() or a fault -----------> Faulted
//       '------------------------- force faded, then tension ---------------------------'
//
// Disarmed: motors carry zero. Tensioning: tension rises to the minimum. Calibrating: minimum tension, until the grip
// has been still for a while; its strings then have their rest lengths. Running: the wrench acts. Faulted: the last
// wrench fades out smoothly, then the tension. Faults stay latched through Disarmed until the next arm().
#pragma once

#include <cstdint>

#include <haptic/frames.hpp>
#include <haptic/realtime.hpp>
#include <haptic/types.hpp>

namespace haptic::rt {

enum class SafetyState : std::uint8_t {
    Disarmed = HAPTIC_DISARMED,
    Tensioning = HAPTIC_TENSIONING,
    Calibrating = HAPTIC_CALIBRATING,
    Running = HAPTIC_RUNNING,
    Faulted = HAPTIC_FAULTED
};

struct SafetySettings {
    std::int64_t tension_ramp_ns = 500'000'000;      // ns, from no tension to the minimum, and back
    std::int64_t calibration_hold_ns = 200'000'000;  // ns, for which the grip must be still to be calibrated
    double calibration_movement = 0.5e-3;            // m, that a string may move in that time
    std::int64_t fault_fade_ns = 100'000'000;        // ns, in which the wrench goes to zero on a fault
    double residual = 1e-3;   // m, rms of measured minus explained lengths; one string 7 mm out makes so much (X3R)
    int residual_ticks = 20;  // in a row, after which a large residual or an undetermined pose is a fault
    int exchange_ticks = 5;   // failed in a row, after which that is a fault
    int overrun_ticks = 100;  // late in a row, after which that is a fault
};

/// From arm() to running, ns, if the grip is held still.
[[nodiscard]] std::int64_t arming_time_ns(const SafetySettings& settings) noexcept;

/// What one tick found.
struct TickHealth {
    std::int64_t elapsed_ns = 0;  // since the last tick
    bool exchange_ok = true;
    bool jump = false;
    bool late = false;
    bool finite = true;
    bool determined = true;         // the strings determine the pose
    bool slack = false;             // the string at fault reads longer than the others explain
    std::uint8_t suspects = 0;      // bit i: string i may be the one at fault, where lengths contradict each other
    bool overheated = false;        // a motor, by the thermal model
    double residual = 0.0;          // m
    double largest_movement = 0.0;  // m, of a string since the last Calibration::Restart
};

class SafetyMachine {
  public:
    explicit SafetyMachine(const SafetySettings& settings) : settings_(settings) {}

    /// Disarmed to Tensioning, faults cleared. Ignored in other states.
    void arm() HAPTIC_RT;
    /// Orderly: as a fault, with the bit HAPTIC_FAULT_STOP.
    void stop() HAPTIC_RT;

    /// As a fault, with the bit HAPTIC_FAULT_NONFINITE: for who has found such a value and taken it out.
    void fault_nonfinite() HAPTIC_RT { fault(HAPTIC_FAULT_NONFINITE); }
    /// Disarmed at once and without a fade, whatever the state: the motors already carry zero. The bits stay latched.
    void cut(std::uint32_t bits) HAPTIC_RT;

    /// What the caller has to do with its counters after update().
    enum class Calibration : std::uint8_t { None, Restart, Take };

    /// One tick on. Restart: the grip moved (or calibration begins), measure movement from here. Take: it was still,
    /// set the rest lengths.
    Calibration update(const TickHealth& health) HAPTIC_RT;

    [[nodiscard]] SafetyState state() const HAPTIC_RT { return state_; }
    /// Bits HAPTIC_FAULT_*, latched.
    [[nodiscard]] std::uint32_t faults() const HAPTIC_RT { return faults_; }

    /// Bit i: string i may be the one that a fault SLACK or RESIDUAL is about; latched as faults() are.
    [[nodiscard]] std::uint8_t suspects() const HAPTIC_RT { return suspects_; }

    /// The wrench that may act: the wanted one while running, the fading last one while faulted, else zero. Not finite
    /// is a fault, and the last good one begins to fade.
    Wrench shape(const Wrench& wanted) HAPTIC_RT;
    /// What limits left of what shape() gave: a fault fades from that, and the tension stays until it is zero.
    void felt(const Wrench& wrench) HAPTIC_RT;
    /// Factor on all tensions, 0..1; smooth.
    [[nodiscard]] double tension_scale() const HAPTIC_RT;

  private:
    void fault(std::uint32_t bits) HAPTIC_RT;
    void watch(const TickHealth& health) HAPTIC_RT;
    void move_ramps(std::int64_t elapsed_ns) HAPTIC_RT;
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
    bool still_felt_ = false;  // a wrench, after the limits
};

}  // namespace haptic::rt
