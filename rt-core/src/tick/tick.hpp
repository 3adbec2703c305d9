// One tick of the real-time loop, without a thread and without a clock of its own, so that tests step it in lockstep.
//
// run() does, in this order: exchange with the board (the last command again, encoders in) - unwrap counts, lengths,
// pose, velocity - newest contact frame, if any - local proxies against its planes - wrench - safety limits - tensions
// - second exchange (motors out, in this same tick; with `exchanges = 1` the next tick's first one brings them) -
// publish the device state - record. A probe, if there is one, is up from the beginning to the end of that.
//
// All memory is allocated by the constructor. After it, run() neither allocates, locks, throws nor waits for anything
// but the board.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>

#include <haptic/device/board.hpp>
#include <haptic/device/variant.hpp>
#include <haptic/frames.hpp>
#include <haptic/realtime.hpp>
#include <haptic/ring.hpp>
#include "device/encoder.hpp"
#include "tick/frame_source.hpp"
#include "tick/heartbeat.hpp"
#include "tick/instruments.hpp"
#include "device/kinematics.hpp"
#include "rendering/limits.hpp"
#include "rendering/passivity.hpp"
#include "tick/recorder.hpp"
#include "rendering/renderer.hpp"
#include "tick/safety.hpp"
#include "device/string_monitor.hpp"
#include "device/tension.hpp"
#include "device/thermal.hpp"
#include "tick/tick_probes.hpp"
#include "tick/tick_record.hpp"
#include "tick/tick_timing.hpp"
#include "device/velocity.hpp"

namespace haptic::rt {

/// What motors bear of which the variant says nothing, and when they are spared.
struct MotorSettings {
    double continuous_share = 0.5;  // of the maximum tension, for ever
    double time_constant_s = 20.0;  // s
    double derate_from = 0.7;       // ThermalSettings::derate_from
};

struct TickSettings {
    device::Variant variant = device::spidar_g6_x3r();
    std::int64_t period_ns = 1'000'000;  // ns, between ticks
    int exchanges = 2;                   // a tick: 2 send its force in the same tick, 1 in the next one
    double maximum_string_speed = 2.0;   // m/s; what is faster is an encoder fault
    int velocity_window_ticks = 8;       // VelocitySettings::window_ticks
    double tension_effort = 1e-5;        // 1, TensionSettings::effort
    Infeasible tension_infeasible = Infeasible::Closest;
    double tension_continuity = 1e-5;  // 1, TensionSettings::continuity
    double tension_rate = 3000.0;      // N/s, of one string; above what the limits of the wrench's rate can cause
    FrameSettings frames;
    WrenchLimits limits;
    PassivitySettings passivity;
    SafetySettings safety;
    MotorSettings motors;
    int stop_button = -1;                                   // switch of the board that stops the loop; -1: none
    bool stop_when_released = false;                        // it is one that opens: then a broken wire stops too
    std::int64_t black_box_ns = 2 * kNanosecondsPerSecond;  // ns, of ticks that are always kept
};

struct TickTime {
    std::int64_t deadline_ns = 0;  // when the tick was due
    std::int64_t now_ns = 0;       // when it began
    std::int64_t missed = 0;       // deadlines that were skipped since the last tick
};

/// Only measures stages; the tick takes its time from TickTime. Lockstep passes a clock that stands still.
using StageClock = std::int64_t (*)() HAPTIC_RT;

class Tick {
  public:
    /// The references must outlive the tick. Throws std::invalid_argument for settings that cannot be.
    Tick(const TickSettings& settings, device::Board& board, RingReader<ContactFrame>& frames,
         RingWriter<DeviceState>& states, StageClock clock);
    Tick(const TickSettings& settings, device::Board& board, FrameSource& frames, RingWriter<DeviceState>& states,
         StageClock clock);
    Tick(const Tick&) = delete;
    Tick& operator=(const Tick&) = delete;
    ~Tick();

    /// One tick. Every path sends tensions within bounds to the board, zero unless armed.
    void run(const TickTime& time) HAPTIC_RT;

    /// Begins tensioning; running follows by itself once the grip was held still at the centre, arming_time_ns() later
    /// at the earliest. Clears faults. Ignored unless disarmed.
    void arm() HAPTIC_RT;
    /// Orderly end: force and tension fade, then safety_state() is Disarmed.
    void stop() HAPTIC_RT {
        requests_ |= kRequestStop;
        safety_.stop();
    }
    /// Sends zero to all motors once, whatever the state; for the way out.
    device::ExchangeStatus send_zero(std::int64_t now_ns) HAPTIC_RT;

    /// From any thread: as stop() in the next tick, and again in each one that is armed after it.
    void stop_for_good() HAPTIC_RT { stop_asked_.store(true); }
    /// From any thread: disarmed from the next tick on, at once, with these bits HAPTIC_FAULT_*, for good. For who has
    /// sent zeros over the tick's head.
    void cut(std::uint32_t faults) HAPTIC_RT { cut_.fetch_or(faults); }
    /// From any thread, once the tick's thread hangs: takes instruments(), black_box(), last() and faults() away from
    /// it, so that they may be read; false if it is not within an exchange with the board. When that exchange ends
    /// after all, its thread sleeps for ever: the process must be left by _exit().
    [[nodiscard]] bool abandon() HAPTIC_RT;
    /// Beats at the end of each tick, once begun.
    [[nodiscard]] Heartbeat& heart() HAPTIC_RT { return heart_; }

    /// Also keeps each further tick in a recorder, which must outlive the tick; nullptr for none.
    void record_to(Recorder* recorder) HAPTIC_RT { recorder_ = recorder; }
    /// Shows each further tick on probes, which must outlive the tick; nullptr for none.
    void show_on(TickProbes* probes) HAPTIC_RT { probes_ = probes; }

    [[nodiscard]] SafetyState safety_state() const HAPTIC_RT { return safety_.state(); }
    /// Bits HAPTIC_FAULT_*.
    [[nodiscard]] std::uint32_t faults() const HAPTIC_RT { return safety_.faults(); }
    /// Bit i: string i may be the one that a fault SLACK or RESIDUAL is about.
    [[nodiscard]] std::uint8_t suspect_strings() const HAPTIC_RT { return safety_.suspects(); }
    /// What the last tick found and did.
    [[nodiscard]] const TickRecord& last() const HAPTIC_RT { return record_; }
    /// Where the time of the last tick went.
    [[nodiscard]] const TickTiming& timing() const HAPTIC_RT { return timing_; }
    [[nodiscard]] const Instruments& instruments() const HAPTIC_RT { return instruments_; }
    /// Measurements go on from these, as after warming up.
    void set_instruments(const Instruments& instruments) HAPTIC_RT { instruments_ = instruments; }
    /// The last ticks, oldest first; not while run() may be running in another thread.
    [[nodiscard]] const BlackBox& black_box() const noexcept { return black_box_; }

  private:
    Tick(const TickSettings& settings, device::Board& board, std::unique_ptr<FrameSource> owned, FrameSource* frames,
         RingWriter<DeviceState>& states, StageClock clock);
    void begin(const TickTime& time) HAPTIC_RT;
    [[nodiscard]] device::ExchangeStatus exchange(device::BoardReading& reading, std::int64_t now_ns) HAPTIC_RT;
    void exchange_in(const TickTime& time) HAPTIC_RT;
    void measure_pose(const TickTime& time) HAPTIC_RT;
    void watch_health() HAPTIC_RT;
    void calibrate() HAPTIC_RT;
    void reset_pose() HAPTIC_RT;
    void take_frame(const TickTime& time) HAPTIC_RT;
    void render_wrench(const TickTime& time) HAPTIC_RT;
    [[nodiscard]] Wrench keep_passive(const Contact& contact) HAPTIC_RT;
    void limit_wrench(const Wrench& wanted) HAPTIC_RT;
    void distribute() HAPTIC_RT;
    void exchange_out(const TickTime& time) HAPTIC_RT;
    void warm_motors() HAPTIC_RT;
    [[nodiscard]] bool stop_button_says_stop() const HAPTIC_RT;
    void publish(const TickTime& time) HAPTIC_RT;
    void finish(const TickTime& time) HAPTIC_RT;
    /// Stage clock since the last call.
    std::int64_t lap() HAPTIC_RT;
    void mark_stage(Histogram& stage, TickStage which) HAPTIC_RT {
        timing_.of(which) = lap();
        stage.record(timing_.of(which));
    }
    void force_arrived(std::int64_t latched_ns) HAPTIC_RT;
    void show(Probe& probe, bool up) HAPTIC_RT;
    void set_flag(bool condition, std::uint32_t flag) HAPTIC_RT { record_.flags |= condition ? flag : 0u; }

    TickSettings settings_;
    device::Board* board_;
    std::unique_ptr<FrameSource> owned_frames_;  // where the caller gave a ring
    FrameSource* frames_;
    RingWriter<DeviceState>* states_;
    StageClock clock_;
    Recorder* recorder_ = nullptr;
    TickProbes* probes_ = nullptr;

    StringEncoders encoders_;
    PoseSolver pose_solver_;
    StringMonitor string_monitor_;
    AdaptiveVelocity velocity_;
    FrameRenderer renderer_;
    Passivity passivity_;
    WrenchLimiter limiter_;
    SafetyMachine safety_;
    ThermalModel thermal_;
    TensionSolver tension_solver_;
    BlackBox black_box_;

    std::atomic<std::uint32_t> cut_{0};  // faults for which others have cut the motors off
    std::atomic<bool> stop_asked_{false};
    RecordOwner records_;
    Heartbeat heart_;

    device::MotorCommand command_;  // sent last
    device::BoardReading reading_;
    device::BoardReading unused_;  // of the second exchange
    DeviceState state_{};
    TickRecord record_;
    TickTiming timing_;
    Instruments instruments_;

    PoseEstimate estimate_;
    WireMatrix wires_{};                    // at that pose
    StringArray sent_{};                    // N, in the last tick
    StringArray held_{};                    // N, by the motors since the last tick, as far as that is known
    std::uint64_t number_ = 0;              // of ticks so far
    std::uint32_t requests_ = kRequestNew;  // since the last tick
    std::int64_t last_now_ns_ = 0;
    std::int64_t last_latch_ns_ = 0;  // of the counters in use
    std::int64_t elapsed_ns_ = 0;     // since the last tick, for rates and ramps
    std::int64_t started_ns_ = 0;     // stage clock at the beginning of the tick
    std::int64_t stage_ns_ = 0;       // stage clock at the end of the last stage
    std::int64_t exchange_ns_ = 0;    // that the first exchange took
    std::int64_t motion_ns_ = -1;     // stage clock at the latch whose force waits to be sent; -1: none does
    bool first_ = true;
    bool latched_ = false;          // counters were taken at least once
    bool in_ok_ = false;            // first exchange of this tick
    bool exchange_failed_ = false;  // either exchange of the last tick
    bool jump_ = false;
    bool late_ = false;
    bool solve_tensions_ = false;  // the pose is calibrated, so that a wrench can be distributed

    /// What the motors hold, for the passivity observer.
    struct HeldCommand {
        StringArray tensions{};
        bool asked = false;  // a wrench other than zero was asked of them
    };
    HeldCommand sent_command_;  // as sent, or still to be sent
    HeldCommand held_command_;  // by the motors
    PassivityMotion motion_;    // since the last tick, under what was held
};

}  // namespace haptic::rt
