// Run: one run of the real-time loop with everything around it, that is the device, the rings, the recording, the
// watchdog and the exit paths. `rt-core run` and `rt-core measure` are built on it.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include "commands/arm_inputs.hpp"
#include "commands/open_device.hpp"
#include "commands/recording_thread.hpp"
#include "commands/run_command.hpp"
#include "commands/run_output.hpp"
#include "commands/stop_signals.hpp"
#include "haptic/config.hpp"
#include "haptic/ring.hpp"
#include "haptic/workspace_region.hpp"
#include "measure/run_report.hpp"
#include "process/arm_switch.hpp"
#include "process/black_box_file.hpp"
#include "process/crash_guard.hpp"
#include "process/frame_thread.hpp"
#include "process/guard_link.hpp"
#include "process/motor_gate.hpp"
#include "process/settings.hpp"
#include "process/supervision.hpp"
#include "process/watchdog.hpp"
#include "program/progress_bar.hpp"
#include "program/results.hpp"

namespace haptic::rt {

/// Sets what the kind of device makes of the settings, so that a replay of the recording does the same: whether the
/// device proves itself, and the recent time for lateness.
void set_for_device(Config& config, const Settings& settings, bool real);

/// Callbacks of a run, called in the thread that supervises it.
class RunHooks {
  public:
    virtual ~RunHooks() = default;
    /// Log in which the loop's thread notes each measured tick; must outlive the run.
    [[nodiscard]] virtual TimingLog& log() = 0;
    /// Called when everything is open and nothing moves yet. Throws to cancel the run.
    virtual void on_ready(const RealtimeSetup& setup) = 0;
    /// Called every 20 ms while the loop runs. Returns false to end the run.
    [[nodiscard]] virtual bool on_poll(std::int64_t now_ns) = 0;
    /// Duration after which the loop ends, with motors at zero, for on_pause(); empty for a run without pauses.
    [[nodiscard]] virtual std::optional<double> segment_s() const = 0;
    /// Called between two segments, while no loop runs; does not count towards the run's duration. Returns false to end
    /// the run.
    [[nodiscard]] virtual bool on_pause(const StopSignals& signals) = 0;
};

/// Origin of a stop, as named in the report.
struct StopReason {
    const char* name = "none";
    bool pressed = false;  // by a person: the last ticks may explain why
};

/// Runs the loop once, or several times in succession where a lost device comes back or the hooks ask for pauses.
/// Members are declared in the order in which they must be constructed.
class Run {  // NOLINT(clang-analyzer-optin.performance.Padding): the order is that of construction
  public:
    /// Reports the result, and returns the exit status of the run. A file that cannot be written goes to `Results`.
    using Conclusion = std::function<int(const RunResult&, const Instruments&, Results&)>;

    /// Opens everything. The references and the hooks (nullptr: none) must outlive the run. Throws Refusal, CsvError,
    /// RingError.
    Run(const RunOptions& options, const Settings& settings, const StopSignals& signals, const RunOutput& output,
        RunHooks* hooks = nullptr);
    Run(const Run&) = delete;
    Run& operator=(const Run&) = delete;
    ~Run();

    /// Runs until the end, and returns the status from `conclude`, or kExitFailed if all went well but for a file. If
    /// the loop hangs, ends the process with that status.
    [[nodiscard]] int execute(const Conclusion& conclude);

  private:
    /// Runs one loop after another until the run is to end or a loop hangs.
    void run_loops();
    /// Runs one loop to its end; false if it hangs for good.
    [[nodiscard]] bool run_loop();
    /// Periodic work while the loop runs: collects the act of a person, calls the hooks, shows how far the run is.
    /// Returns false to end the run.
    [[nodiscard]] bool poll();
    /// Announces that a person must arm, and that one did.
    void poll_arming();
    /// Recovers a lost device or pauses, whichever is due; false if the run is to end.
    [[nodiscard]] bool continue_after_loop();
    [[nodiscard]] bool pause_due() const;
    [[nodiscard]] bool pause();
    /// True if the loop ended because the device was lost.
    [[nodiscard]] bool lost_device() const;
    /// True if it did, nothing has asked for a stop, and waiting for the device is enabled.
    [[nodiscard]] bool can_recover() const;
    /// Starts everything that can stop the loop: the guard of a real device, watchdog and stop line.
    void start_supervisors();
    [[nodiscard]] Supervision supervision() const;
    /// Gives the guard a device that was opened again; false if the guard is gone.
    [[nodiscard]] bool renew_guard();
    void collect_supervision();
    /// Waits until the recording is written, while the motors are at zero. If that takes long, a signal ends the wait.
    void finish_recording();
    /// Keeps the last ticks and waits for the lost device; false if the run is to end first.
    [[nodiscard]] bool recover_device();
    [[nodiscard]] std::int64_t end_ns() const;
    /// Fills result_, and copies the instruments if the tick's records belong to this thread.
    void collect(Instruments& instruments, bool own_records);
    [[nodiscard]] bool should_keep_black_box() const;
    /// Writes the last ticks to a file and returns its path; empty if it cannot be written.
    std::string keep_black_box();

    const RunOptions& options_;
    const Settings& settings_;
    const StopSignals& signals_;
    const RunOutput& output_;
    RunHooks* hooks_;
    RunResult result_;
    Results results_;
    StopReason stop_;
    bool hung_ = false;                  // the loop's thread will not end
    bool device_not_recovered_ = false;  // the run ended while waiting for a lost device
    std::int64_t start_ns_ = 0;
    std::int64_t paused_ns_ = 0;
    ArmSwitch person_;
    bool person_arms_ = false;     // the next loop
    bool person_awaited_ = false;  // and this was announced
    bool budget_warned_ = false;
    std::optional<ProgressBar> progress_;  // while a run of limited duration runs

    std::unique_ptr<OpenedDevice> device_;
    RingReader<ContactFrame> frames_;
    RingFrames frame_source_;
    RingWriter<DeviceState> states_;
    std::optional<RingReader<WrenchOverlay>> overlay_ring_;  // none unless the settings allow an overlay
    std::optional<RingOverlays> overlays_;
    ArmInputs arm_inputs_;
    std::optional<PublishedRegion> region_;  // of the walls
    SharedSupervision shared_;
    std::unique_ptr<BlackBoxFile> black_box_file_;  // none: the black box dies with the process
    MotorGate gate_;
    TickProbes probes_;
    Tick tick_;
    std::unique_ptr<RecordingThread> recording_;  // none without --record
    AlternateSignalStack signal_stack_;
    CrashGuard guard_;
    RealtimeSetup prepared_;
    std::unique_ptr<GuardLink> guard_link_;    // none for an emulated device; outlives all that motors may follow
    std::unique_ptr<Watchdog> watchdog_;       // outlives the loop, to watch its end too
    std::optional<FrameThread> frame_thread_;  // ends after the loop, and before the tick whose buffers it fills
    std::unique_ptr<RealtimeLoop> loop_;
    std::unique_ptr<StopLineMonitor> stop_monitor_;
};

}  // namespace haptic::rt
