// One tick of the real-time loop. It has no thread and no clock of its own, so that tests can step it in lockstep.
//
// run() does, in this order:
//   1. answer to the last tick's motor command, if the board left it to this one; exchange with the board: sends the
//      last command again, reads the encoders
//   2. counts to string lengths, pose and velocity; health checks and the safety machine
//   3. newest contact frame, if any; local proxies against its planes; wrench
//   4. passivity; newest wrench overlay, if any; safety machine and limits of the wrench; tensions
//   5. sends the motors in this same tick (with `exchanges = 1` the next tick's exchange does)
//   6. publishes the device state; records
// A probe, if there is one, is high for the whole tick.
//
// All memory is allocated by the constructor. run() neither allocates, locks, throws nor waits for anything but the
// board.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <span>

#include "device/encoder.hpp"
#include "device/kinematics.hpp"
#include "device/string_monitor.hpp"
#include "device/tension.hpp"
#include "device/thermal.hpp"
#include "device/velocity.hpp"
#include "haptic/device/board.hpp"
#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"
#include "haptic/ring.hpp"
#include "rendering/limits.hpp"
#include "rendering/overlay.hpp"
#include "rendering/passivity.hpp"
#include "rendering/renderer.hpp"
#include "rendering/workspace_walls.hpp"
#include "tick/device_proof.hpp"
#include "tick/force_budget.hpp"
#include "tick/frame_intake.hpp"
#include "tick/heartbeat.hpp"
#include "tick/instruments.hpp"
#include "tick/recorder.hpp"
#include "tick/safety.hpp"
#include "tick/slot_source.hpp"
#include "tick/tick_probes.hpp"
#include "tick/tick_record.hpp"
#include "tick/tick_settings.hpp"
#include "tick/tick_timing.hpp"

namespace haptic::rt {

struct TickTime {
    std::int64_t deadline_ns = 0;  // when the tick was due
    std::int64_t now_ns = 0;       // when it began
    std::int64_t missed = 0;       // deadlines skipped since the last tick
};

/// Clock for measuring stages only; the tick takes its time from TickTime. Lockstep passes a clock that stands still.
using StageClock = std::int64_t (*)() HAPTIC_RT;

class Tick {
  public:
    /// The references must outlive the tick. Throws std::invalid_argument for invalid settings.
    Tick(const TickSettings& settings, device::Board& board, RingReader<ContactFrame>& frames,
         RingWriter<DeviceState>& states, StageClock clock);
    Tick(const TickSettings& settings, device::Board& board, FrameSource& frames, RingWriter<DeviceState>& states,
         StageClock clock);
    Tick(const Tick&) = delete;
    Tick& operator=(const Tick&) = delete;

    /// Runs one tick. Every path sends tensions within bounds to the board, and zero unless armed.
    void run(const TickTime& time) HAPTIC_RT;

    /// Clears faults and begins tensioning. Running follows once the grip has been held still at the centre, after
    /// arming_time_ns() at the earliest. Ignored unless disarmed.
    void arm() HAPTIC_RT;
    /// Flags each further tick as disarmed until a person arms the device; until arm().
    void await_person() HAPTIC_RT {
        requests_ |= kRequestAwait;
        awaits_person_ = true;
    }
    /// Orderly stop: force and tension fade, then safety_state() is Disarmed.
    void stop() HAPTIC_RT {
        requests_ |= kRequestStop;
        safety_.stop();
    }
    /// Sends zero to all motors once, in any state; for the end of the process.
    device::ExchangeStatus send_zero(std::int64_t now_ns) HAPTIC_RT;

    /// From any thread: stop() at the next tick, and again after any later arm().
    void stop_for_good() HAPTIC_RT { stop_requested_.store(true); }
    /// From any thread: disarms at the next tick, without a fade and permanently, with these bits HAPTIC_FAULT_*. For a
    /// thread that has sent zeros to the motors itself.
    void cut(std::uint32_t faults) HAPTIC_RT { cut_.fetch_or(faults); }
    /// From any thread, once the tick's thread hangs: takes instruments(), black_box(), last() and faults() over from
    /// it, so that they may be read. Returns false if the thread is not in an exchange with the board. If that exchange
    /// ends after all, its thread sleeps forever, so the process must be left by _exit().
    [[nodiscard]] bool abandon() HAPTIC_RT;
    /// Beats at the end of each tick, once begun.
    [[nodiscard]] Heartbeat& heart() HAPTIC_RT { return heart_; }

    /// Also pushes every further tick to a recorder, which must outlive the tick; nullptr for none.
    void record_to(Recorder* recorder) HAPTIC_RT { recorder_ = recorder; }
    /// Takes frames from this intake, which must outlive the tick, instead of reading them itself; before the first
    /// run().
    void take_frames_from(FrameIntake& intake) HAPTIC_RT { intake_ = &intake; }
    /// Takes wrench overlays from this source, which must outlive the tick; nullptr for none. Only if the settings
    /// allow some.
    void overlay_from(OverlaySource* overlays) HAPTIC_RT { overlays_ = settings_.overlay.on() ? overlays : nullptr; }
    /// Shows each further tick on probes, which must outlive the tick; nullptr for none.
    void show_on(TickProbes* probes) HAPTIC_RT { probes_ = probes; }

    [[nodiscard]] SafetyState safety_state() const HAPTIC_RT { return safety_.state(); }
    /// Bits HAPTIC_FAULT_*.
    [[nodiscard]] std::uint32_t faults() const HAPTIC_RT { return safety_.faults(); }
    /// Bit i: string i is a suspect of the fault SLACK or RESIDUAL.
    [[nodiscard]] std::uint8_t suspect_strings() const HAPTIC_RT { return safety_.suspects(); }
    /// What the device has proved since it was armed.
    [[nodiscard]] DeviceProofResult proof() const noexcept { return proof_.result(); }
    /// Record of the last tick.
    [[nodiscard]] const TickRecord& last() const HAPTIC_RT { return record_; }
    /// Stage durations of the last tick.
    [[nodiscard]] const TickTiming& timing() const HAPTIC_RT { return timing_; }
    [[nodiscard]] const Instruments& instruments() const HAPTIC_RT { return *instruments_; }
    /// Use of the session's budget. Must not be read while run() may be running in another thread.
    [[nodiscard]] const ForceBudget& budget() const HAPTIC_RT { return budget_; }
    /// Replaces the measurements, as after the warm-up, and returns those until then. Not nullptr.
    void swap_instruments(std::unique_ptr<Instruments>& other) HAPTIC_RT { instruments_.swap(other); }
    /// Keeps the black box in this memory, of at least BlackBox::bytes(black_box().capacity()), which must outlive the
    /// tick; before the first run().
    void keep_black_box_in(std::span<std::byte> memory) { black_box_.store_in(memory); }
    /// The last ticks, oldest first. Must not be read while run() may be running in another thread.
    [[nodiscard]] const BlackBox& black_box() const noexcept { return black_box_; }

  private:
    Tick(const TickSettings& settings, device::Board& board, std::unique_ptr<FrameSource> owned, FrameSource* frames,
         RingWriter<DeviceState>& states, StageClock clock);
    void begin(const TickTime& time) HAPTIC_RT;
    [[nodiscard]] device::ExchangeStatus exchange(device::BoardReading& reading, std::int64_t now_ns) HAPTIC_RT;
    /// The calls of the board that do not read the encoders; as exchange().
    [[nodiscard]] device::ExchangeStatus send(std::int64_t now_ns) HAPTIC_RT;
    [[nodiscard]] device::ExchangeStatus collect(std::int64_t now_ns) HAPTIC_RT;
    /// Makes a call of the board, which may hang: never returns if the watchdog took the records meanwhile.
    template <class Call>
    [[nodiscard]] device::ExchangeStatus lend_records(const Call& call) HAPTIC_RT;
    /// Receives the answer to the last tick's motor command, if it is due, and corrects what was assumed of it.
    void collect_answer(const TickTime& time) HAPTIC_RT;
    void exchange_in(const TickTime& time) HAPTIC_RT;
    void measure_pose(const TickTime& time) HAPTIC_RT;
    void check_health() HAPTIC_RT;
    void update_proof(TickHealth& health) HAPTIC_RT;
    void calibrate() HAPTIC_RT;
    void reset_pose() HAPTIC_RT;
    void read_frame(const TickTime& time) HAPTIC_RT;
    void read_overlay(const TickTime& time) HAPTIC_RT;
    void render_wrench(const TickTime& time) HAPTIC_RT;
    [[nodiscard]] Wrench apply_passivity(const FrameRenderer::Result& rendered) HAPTIC_RT;
    [[nodiscard]] Wrench render_overlay(const TickTime& time, bool running) HAPTIC_RT;
    void limit_wrench(const Wrench& wanted, const Wrench& without_overlay) HAPTIC_RT;
    void separate_pushes(const FrameRenderer::Result& rendered) HAPTIC_RT;
    void solve_tensions() HAPTIC_RT;
    void exchange_out(const TickTime& time) HAPTIC_RT;
    void update_thermal_model() HAPTIC_RT;
    [[nodiscard]] bool stop_button_active() const HAPTIC_RT;
    [[nodiscard]] Wrench contact_wrench(double scale, const Wrench& overlay) HAPTIC_RT;
    void push_back(FrameRenderer::Result& rendered) HAPTIC_RT;
    void spend_budget() HAPTIC_RT;
    void integrate_wrench() HAPTIC_RT;
    void publish(const TickTime& time) HAPTIC_RT;
    void finish(const TickTime& time) HAPTIC_RT;
    void record_link_quality() HAPTIC_RT;
    /// ns of the stage clock since the last call.
    std::int64_t lap() HAPTIC_RT;
    void mark_stage(Histogram& stage, TickStage which) HAPTIC_RT {
        timing_.of(which) = lap();
        stage.record(timing_.of(which));
    }
    void record_motion_to_force(std::int64_t latched_ns) HAPTIC_RT;
    void set_probe(Probe& probe, bool up) HAPTIC_RT;
    void drive_relay() HAPTIC_RT;
    void set_flag(bool condition, std::uint32_t flag) HAPTIC_RT { record_.flags |= condition ? flag : 0u; }

    TickSettings settings_;
    device::Board* board_;
    std::unique_ptr<FrameSource> owned_frames_;  // if the caller passed a ring
    FrameIntakeInTick intake_in_tick_;
    FrameIntake* intake_ = &intake_in_tick_;
    RingWriter<DeviceState>* states_;
    StageClock clock_;
    OverlaySource* overlays_ = nullptr;
    Recorder* recorder_ = nullptr;
    TickProbes* probes_ = nullptr;

    StringEncoders encoders_;
    PoseSolver pose_solver_;
    StringMonitor string_monitor_;
    AdaptiveVelocity velocity_;
    FrameRenderer renderer_;
    Passivity passivity_;
    Overlay overlay_;
    WrenchLimiter limiter_;
    WrenchLimiter limiter_without_overlay_;
    ForceBudget budget_;
    SafetyMachine safety_;
    DeviceProof proof_;
    ThermalModel thermal_;
    TensionSolver tension_solver_;
    TensionSolver idle_solver_;  // of the wrench that the strings exert while none is wanted
    BlackBox black_box_;

    std::atomic<std::uint32_t> cut_{0};  // faults for which another thread disarmed the motors
    std::atomic<bool> stop_requested_{false};
    RecordOwner records_;
    Heartbeat heart_;

    device::MotorCommand command_;  // sent last
    device::BoardReading reading_;
    device::BoardReading unused_;  // reading of send_zero()
    DeviceState state_{};
    TickRecord record_;
    TickTiming timing_;
    std::unique_ptr<Instruments> instruments_;

    PoseEstimate estimate_;
    WireMatrix wires_{};                    // at that pose
    StringArray sent_{};                    // N, in the last tick
    StringArray held_{};                    // N, held by the motors since the last tick, best knowledge
    StringArray held_before_{};             // N, before the last command was sent
    std::uint64_t number_ = 0;              // of this tick
    std::uint32_t requests_ = kRequestNew;  // since the last tick
    std::int64_t last_now_ns_ = 0;
    std::int64_t last_latch_ns_ = 0;   // of the counters in use
    std::int64_t elapsed_ns_ = 0;      // since the last tick, clamped, for rates
    std::int64_t late_ns_ = 0;         // since the first missed deadline; 0: in time
    std::int64_t started_ns_ = 0;      // stage clock at the beginning of the tick
    std::int64_t stage_ns_ = 0;        // stage clock at the end of the last stage
    std::int64_t exchange_ns_ = 0;     // duration of the first exchange
    std::int64_t unanswered_ns_ = -1;  // motion to force, of a command whose answer is due; -1: none
    std::int64_t motion_ns_ = -1;      // stage clock at the latch whose force is yet to be sent; -1: none
    bool first_ = true;
    bool latched_ = false;          // the encoders have accepted a latch
    bool in_ok_ = false;            // first exchange of this tick
    bool exchange_failed_ = false;  // either exchange of the last tick
    bool answer_lost_ = false;      // that of the last tick's motor command, as this tick found
    bool jump_ = false;
    bool awaits_person_ = false;     // to arm
    bool directions_known_ = false;  // the pose is calibrated, so a wrench can be distributed

    /// Pushes beside the contact, as parts of the rendered wrench. The simulation's bodies feel neither. The passivity
    /// observer accounts for the walls, which are springs; the overlay's work is for the budget alone.
    struct Pushes {
        Wrench walls;    // of the workspace
        Wrench overlay;  // what is rendered, less what would be rendered without it
    };
    /// Tensions that the motors hold, for the passivity observer.
    struct HeldCommand {
        StringArray tensions{};
        bool requested = false;  // a wrench that is not zero, without the overlay
        Wrench contact;          // exerted because of the request of the frame
        Wrench overlay;          // exerted because of the overlay
    };
    WallPush walls_;                   // of the workspace, in this tick
    Pushes pushes_;                    // in this tick
    bool frame_requests_ = false;      // a wrench in this tick, without the pushes
    HeldCommand sent_command_;         // sent, or to be sent next
    HeldCommand held_command_;         // held by the motors
    HeldCommand held_before_command_;  // before the last command was sent
    PassivityMotion motion_;           // since the last tick, under the held command
    Wrench held_contact_;              // of the held command since the last tick, exerted because of the frame
    Wrench held_overlay_;              // of the held command since the last tick, exerted because of the overlay
    Wrench impulse_;                   // N*s and N*m*s, integral of held_contact_ since the process began
};

}  // namespace haptic::rt
