// Safety machine: decides which tension and wrench the motors may carry in each state, and reacts to faults.
//
//             arm()           ramp done         proved           held still          stop() or a fault
//   Disarmed ------> Tensioning ------> Proving ------> Calibrating ------> Running ------------------.
//       ^                 |                |                 |                                        v
//       |                 '----------------'-----------------'----- stop() or a fault ----------> Faulted
//       '------------------------- force faded, then tension -----------------------------------------'
//
// Disarmed: motors at zero. Tensioning: tension ramps up. Proving: each motor in turn pulls slightly more and less, and
// its own string must answer (wiring_proof.hpp); only if SafetySettings::prove. Calibrating: minimum tension until the
// grip has been held still for a while; the strings then have their rest lengths. Running: the wrench is rendered.
// Faulted: the last wrench fades out smoothly, then the tension. Faults stay latched through Disarmed until the next
// arm().
//
// Lost exchanges, lateness and contradicting lengths are judged by the share of recent time that they took
// (recent_share.hpp), so that neither the period nor the pattern in which they come matters.
#pragma once

#include <cstdint>

#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"
#include "haptic/types.hpp"
#include "tick/recent_share.hpp"

namespace haptic::rt {

enum class SafetyState : std::uint8_t {
    Disarmed = HAPTIC_DISARMED,
    Tensioning = HAPTIC_TENSIONING,
    Calibrating = HAPTIC_CALIBRATING,
    Running = HAPTIC_RUNNING,
    Faulted = HAPTIC_FAULTED,
    Proving = HAPTIC_PROVING
};

struct SafetySettings {
    std::int64_t tension_ramp_ns = 500'000'000;      // ns, from zero tension to the minimum, and back
    std::int64_t calibration_hold_ns = 200'000'000;  // ns, for which the grip must be held still
    double calibration_movement = 0.5e-3;            // m, that a string may move in that time
    std::int64_t fault_fade_ns = 100'000'000;        // ns, in which the wrench fades to zero on a fault
    double residual = 1e-3;  // m, rms of measured minus explained lengths; one string off by 7 mm gives this (X3R)
    bool prove = false;      // the device proves its wiring before calibration, and its pose before full force

    // Faults by the share of recent time that they took. At the default window a condition that holds from now on is a
    // fault after 22 ms at 0.2, 29 ms at 0.25 and 36 ms at 0.3.
    std::int64_t window_ns = 100'000'000;       // ns, recent time
    std::int64_t late_window_ns = 100'000'000;  // ns, recent time for lateness
    double residual_share = 0.2;                // with a large residual or an undetermined pose
    double exchange_share = 0.25;               // without an answer from the board
    double late_share = 0.3;                    // after missed deadlines
    std::int64_t encoder_age_ns = 20'000'000;   // ns, oldest counters to act on
};

/// ns, from arm() to Running if the grip is held still, without the time that the proof of the device takes.
[[nodiscard]] std::int64_t arming_time_ns(const SafetySettings& settings) noexcept;

/// Verdict of the proof of the device's wiring.
enum class Proof : std::uint8_t { Pending, Passed, Refused };

/// Findings of one tick.
struct TickHealth {
    std::int64_t elapsed_ns = 0;      // since the last tick
    std::int64_t late_ns = 0;         // of it, after a deadline that was missed
    std::int64_t encoder_age_ns = 0;  // since the last latch, if this tick has none
    bool exchange_ok = true;
    bool jump = false;
    bool finite = true;
    bool determined = true;     // the strings determine the pose
    bool slack = false;         // all suspects read longer than the others explain
    std::uint8_t suspects = 0;  // bit i: string i may be faulty; 0 while the lengths agree
    std::uint8_t mixed_up = 0;  // bit i: string i may be exchanged, or count backwards, in a pose that is not proved
    bool overheated = false;    // some motor, by the thermal model
    Proof wiring = Proof::Pending;  // of the wiring, while Proving
    Proof pose = Proof::Pending;    // of the pose, while Running; Refused: the grip was not at the centre, or not level
    double residual = 0.0;          // m
    double largest_movement = 0.0;  // m, of a string since the last Calibration::Restart
};

/// Shares of recent time, 0..1, by which the safety machine judges.
struct RecentShares {
    double exchange = 0.0;
    double late = 0.0;
    double residual = 0.0;
};

class SafetyMachine {
  public:
    explicit SafetyMachine(const SafetySettings& settings) HAPTIC_RT;

    /// From Disarmed to Tensioning, clearing the faults. Ignored in other states.
    void arm() HAPTIC_RT;
    /// Orderly stop: handled like a fault, with the bit HAPTIC_FAULT_STOP.
    void stop() HAPTIC_RT;

    /// Raises HAPTIC_FAULT_NONFINITE, for a caller that found and removed such a value.
    void fault_nonfinite() HAPTIC_RT { fault(HAPTIC_FAULT_NONFINITE); }
    /// Raises HAPTIC_FAULT_BUDGET.
    void fault_budget() HAPTIC_RT { fault(HAPTIC_FAULT_BUDGET); }
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

    [[nodiscard]] RecentShares shares() const HAPTIC_RT {
        return {exchange_.value(), late_.value(), residual_.value()};
    }
    /// Bit i: string i is a suspect of the fault SLACK, RESIDUAL, WIRING or JUMP; latched like faults().
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
    void update_shares(const TickHealth& health) HAPTIC_RT;
    void check_faults(const TickHealth& health) HAPTIC_RT;
    void advance_ramps(std::int64_t elapsed_ns) HAPTIC_RT;
    Calibration begin_calibration() HAPTIC_RT;
    Calibration calibrate(const TickHealth& health) HAPTIC_RT;

    SafetySettings settings_;
    SafetyState state_ = SafetyState::Disarmed;
    std::uint32_t faults_ = 0;
    std::uint8_t suspects_ = 0;
    RecentShare exchange_;
    RecentShare late_;
    RecentShare residual_;
    std::int64_t still_ns_ = 0;
    double tension_ = 0.0;      // 0..1, linear in time
    double wrench_fade_ = 0.0;  // 1..0 while faulted, linear in time
    Wrench last_wrench_;
    bool rendered_ = false;  // the wrench after the limits is not zero
};

}  // namespace haptic::rt
