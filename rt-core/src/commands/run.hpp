// One run of the real-time loop and of everything around it: the device, the rings, the recording, the watchdog and the
// ways out. `rt-core run` is one; `rt-core measure` is one that somebody accompanies.
#pragma once

#include <csignal>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include <haptic/config.hpp>
#include <haptic/ring.hpp>
#include "process/crash_guard.hpp"
#include "process/motor_gate.hpp"
#include "measure/recording.hpp"
#include "measure/run_report.hpp"
#include "process/settings.hpp"
#include "process/watchdog.hpp"
#include "commands/open_device.hpp"
#include "commands/run_command.hpp"

namespace haptic::rt {

/// Signals that mean an orderly stop wait to be asked for, in every thread that is created from here on. SIGTSTP
/// (Ctrl-Z) is one of them: a process that stands still leaves its motors pulling. So would one that is stopped or
/// killed for writing to a terminal or a pipe that it may not write to.
class StopSignals {
  public:
    StopSignals();
    /// Waits for one, at most so long. The signal's number, 0 for none.
    [[nodiscard]] int wait(std::int64_t at_most_ns) const;

  private:
    sigset_t set_{};
};

/// Goes with a run, in the thread that supervises it.
class RunCompanion {
  public:
    virtual ~RunCompanion() = default;
    /// Where the loop's thread notes each tick that is measured; it must outlive the run.
    [[nodiscard]] virtual TimingLog& log() = 0;
    /// Everything is open and nothing moves yet. What is missing to go on is thrown here.
    virtual void begin(const RealtimeSetup& setup) = 0;
    /// Every 20 ms while the loop runs.
    virtual void look(std::int64_t now_ns) = 0;
    /// After so long the loop ends, motors at zero, for a pause(); nothing: it does not.
    [[nodiscard]] virtual std::optional<double> stretch_s() const = 0;
    /// Does what it likes while no loop runs; the run's duration stands still. False: the run is to end.
    [[nodiscard]] virtual bool pause(const StopSignals& signals) = 0;
};

/// Who asked for the stop, as the report says it.
struct StopReason {
    const char* name = "none";
    bool pressed = false;  // a person did: then the last ticks may tell why
};

/// The configuration that the options name. Throws ConfigError.
[[nodiscard]] Config load_config(const RunOptions& options);

/// Runs the loop once, or several times one after the other where the device is lost and comes back, or where there are
/// pauses. Members are in the order in which they have to be there, and go the other way round.
class Run {  // NOLINT(clang-analyzer-optin.performance.Padding): the order is that of their lives
  public:
    /// Makes of the result what the run is for, and returns the exit status of the process.
    using Conclusion = std::function<int(const RunResult&, const Instruments&)>;

    /// Opens everything; the references and the companion (nullptr: none) must outlive it. Throws Refusal, CsvError,
    /// RingError.
    Run(const RunOptions& options, const Settings& settings, const StopSignals& signals,
        RunCompanion* companion = nullptr);

    /// Runs, and returns the conclusion's status when the loop has ended; ends the process with it if the loop hangs.
    [[nodiscard]] int execute(const Conclusion& conclude);

  private:
    /// Loop after loop, until the run is to end or one hangs.
    void run_loops();
    /// False if it hangs and does not come back.
    [[nodiscard]] bool run_loop();
    /// False if the run is to end.
    [[nodiscard]] bool go_on_after_loop();
    [[nodiscard]] bool pause_is_due() const;
    [[nodiscard]] bool pause();
    [[nodiscard]] bool may_come_back() const;
    /// After an exchange fault that has faded: keeps the last ticks and waits. False if the run is to end.
    [[nodiscard]] bool come_back();
    [[nodiscard]] std::int64_t end_ns() const;
    void collect(Instruments& instruments, bool records_ours);
    [[nodiscard]] bool black_box_is_worth_keeping() const;

    const RunOptions& options_;
    const Settings& settings_;
    const StopSignals& signals_;
    RunCompanion* companion_;
    RunResult result_;
    StopReason stop_;
    bool hung_ = false;            // the loop does not come back
    bool waited_in_vain_ = false;  // for a device that was lost
    std::int64_t start_ns_ = 0;
    std::int64_t paused_ns_ = 0;

    std::unique_ptr<OpenedDevice> device_;
    RingReader<ContactFrame> frames_;
    RingWriter<DeviceState> states_;
    MotorGate gate_;
    TickProbes probes_;
    Tick tick_;
    Recorder recorder_;
    std::optional<RecordFile> record_;
    AlternateSignalStack signal_stack_;
    CrashGuard guard_;
    RealtimeSetup prepared_;
    std::unique_ptr<Watchdog> watchdog_;  // outlives the loop, so that it also watches it end
    std::unique_ptr<RealtimeLoop> loop_;
    std::unique_ptr<StopWatch> stop_watch_;
};

}  // namespace haptic::rt
