#include "run_command.hpp"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <ctime>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "haptic/clock.hpp"
#include "haptic/other_users.hpp"
#include "haptic/report.hpp"
#include "haptic/ring.hpp"
#include "haptic/rt/crash_guard.hpp"
#include "haptic/rt/motor_gate.hpp"
#include "haptic/rt/recording.hpp"
#include "haptic/rt/run_report.hpp"
#include "haptic/rt/settings.hpp"
#include "haptic/rt/watchdog.hpp"
#include "open_device.hpp"
#include "replay_command.hpp"

namespace haptic::rt {
namespace {

constexpr std::int64_t kPollNs = 20'000'000;
// Between two attempts to open a device that was lost.
constexpr std::int64_t kReopenNs = 200'000'000;
// What a device that is gone may cause; any other fault ends the run.
constexpr std::uint32_t kFaultsOfLoss = HAPTIC_FAULT_EXCHANGE | HAPTIC_FAULT_OVERRUN;
// For which a loop that hangs may still come back before the process is left without it.
constexpr std::int64_t kHungWaitNs = 1'000'000'000;
// A loop without real-time privileges, which drives no real device, may be kept waiting by others for so long.
constexpr std::int64_t kDegradedWatchdogNs = 2'000'000'000;

/// Signals that mean an orderly stop wait to be asked for, in every thread that is created from here on. SIGTSTP
/// (Ctrl-Z) is one of them: a process that stands still leaves its motors pulling. So would one that is stopped or
/// killed for writing to a terminal or a pipe that it may not write to.
class StopSignals {
  public:
    StopSignals() {
        sigemptyset(&set_);
        for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGTSTP}) {
            sigaddset(&set_, signal);
        }
        for (const int signal : {SIGPIPE, SIGTTIN, SIGTTOU}) {
            std::signal(signal, SIG_IGN);
        }
        pthread_sigmask(SIG_BLOCK, &set_, nullptr);
    }
    /// Waits for one, at most so long. The signal's number, 0 for none.
    [[nodiscard]] int wait(std::int64_t at_most_ns) const {
        const timespec time{at_most_ns / kNanosecondsPerSecond, at_most_ns % kNanosecondsPerSecond};
        const int signal = sigtimedwait(&set_, nullptr, &time);
        return signal > 0 ? signal : 0;  // EAGAIN and EINTR: none yet
    }

  private:
    sigset_t set_{};
};

Config load_config(const RunOptions& options) {
    Config config = options.config ? Config::load(*options.config) : Config();
    for (const std::string& assignment : options.assignments) {
        config.set(assignment);
    }
    return config;
}

/// Says what the kernel refused and how to grant it. A real device is not driven by a loop that may be late.
void judge_setup(const RealtimeSetup& setup, bool real) {
    for (const MissingPrivilege& one : setup.missing) {
        spdlog::warn("degraded: {}", one.what);
        spdlog::warn("  it needs {}", one.needs);
        spdlog::warn("  {}", one.remedy);
    }
    if (setup.degraded() && real) {
        throw Refusal("a real device is not driven without real-time privileges: see above for what is missing");
    }
    if (setup.degraded()) {
        spdlog::warn("going on because the device is emulated");
    }
}

/// Of the nth fault of this run, from 0.
std::filesystem::path black_box_path(const RunOptions& options, std::size_t nth) {
    const std::string extension = nth == 0 ? "fault.csv" : "fault-" + std::to_string(nth + 1) + ".csv";
    if (options.report) {
        return std::filesystem::path(*options.report).replace_extension(extension);
    }
    if (options.record) {
        return std::filesystem::path(*options.record).replace_extension(extension);
    }
    return "rt-core-" + options.session + "." + extension;
}

std::string keep_black_box(const RunOptions& options, const Tick& tick, std::size_t nth) {
    const std::filesystem::path box = black_box_path(options, nth);
    write_black_box(box, tick.black_box());
    const bool fault = (tick.faults() & ~std::uint32_t{HAPTIC_FAULT_STOP}) != 0;
    spdlog::log(fault ? spdlog::level::err : spdlog::level::info, "{}: the last {} ticks are in {}",
                fault ? "faulted" : "stopped", tick.black_box().size(), box.string());
    return box.string();
}

/// When the run is to end by itself.
std::int64_t end_of(std::int64_t start_ns, const std::optional<double>& duration_s) {
    return duration_s ? start_ns + nanoseconds(*duration_s) : std::numeric_limits<std::int64_t>::max();
}

/// Who asked for the stop, as the report says it.
struct StopReason {
    const char* name = "none";
    bool pressed = false;  // a person did: then the last ticks may tell why
};

/// What may end a run.
struct Watchers {
    const StopSignals& signals;
    const Watchdog& watchdog;
    const StopWatch* stop_watch;  // nullptr: no stop line
    const RunObserver* observer;  // nullptr: none
};

/// Waits for the end, writing the recording meanwhile. False if the loop hangs and does not come back.
bool supervise(RealtimeLoop& loop, const Watchers& watchers, std::optional<RecordFile>& record, std::int64_t end_ns,
               StopReason& reason) {
    bool announced = false;
    bool stopping = false;
    std::int64_t hung_ns = 0;
    while (!loop.finished()) {
        if (watchers.watchdog.fired() && hung_ns == 0) {
            spdlog::error("watchdog: the loop hangs; zeros were sent to the motors");
            hung_ns = monotonic_now_ns();
        }
        if (hung_ns != 0 && monotonic_now_ns() - hung_ns > kHungWaitNs) {
            return false;
        }
        const int signal = watchers.signals.wait(kPollNs);
        const bool over = monotonic_now_ns() >= end_ns || (watchers.observer != nullptr && watchers.observer->done());
        if ((signal != 0 || over) && !stopping) {
            spdlog::info("stopping: {}", signal != 0 ? "asked to by a signal" : "the time is over");
            loop.request_stop();
            reason = {signal != 0 ? "signal" : "duration", signal != 0};
            stopping = true;
        }
        if (watchers.stop_watch != nullptr && watchers.stop_watch->stopped() && !stopping) {
            spdlog::warn("stopping: {}", watchers.stop_watch->reason());
            reason = {"line", true};
            stopping = true;
        }
        if (!announced && loop.safety_state() == SafetyState::Running) {
            spdlog::info("running");
            announced = true;
        }
        if (record) {
            record->drain();
        }
    }
    return true;
}

/// Waits for a device that was lost. False if the run is to end first.
bool wait_until_back(OpenedDevice& device, const StopSignals& signals, std::int64_t end_ns) {
    spdlog::warn("waiting until {} is back; Ctrl-C ends the run", device.description());
    std::string problem;
    while (true) {
        try {
            device.reopen();
            spdlog::info("{} is back; keep the grip still at the centre", device.description());
            return true;
        } catch (const device::BoardError& error) {
            if (problem != error.what()) {
                problem = error.what();
                spdlog::info("not yet: {}", problem);
            }
        }
        if (signals.wait(kReopenNs) != 0 || monotonic_now_ns() >= end_ns) {
            spdlog::info("stopping: the device has not come back");
            return false;
        }
    }
}

/// After an exchange fault that has faded: keeps the last ticks and waits. False if the run is to end.
bool come_back(OpenedDevice& device, const Tick& tick, const RunOptions& options, const StopSignals& signals,
               std::int64_t start_ns, RunResult& result) {
    const std::int64_t lost_ns = monotonic_now_ns();
    Interruption interruption;
    interruption.at_s = seconds(lost_ns - start_ns);
    interruption.faults = tick.faults();
    interruption.cause = tick.instruments().last_failure;
    interruption.black_box = keep_black_box(options, tick, result.interruptions.size());
    const bool back = wait_until_back(device, signals, end_of(start_ns, options.duration_s));
    interruption.lost_s = seconds(monotonic_now_ns() - lost_ns);
    result.interruptions.push_back(std::move(interruption));
    return back;
}

WatchdogSettings watchdog_settings(const Settings& settings, const RealtimeSetup& setup) {
    WatchdogSettings result = settings.watchdog;
    result.loop_cpu = setup.cpu >= 0 ? setup.cpu : settings.loop.cpu;
    result.limit_ns = setup.degraded() ? std::max(result.limit_ns, kDegradedWatchdogNs) : result.limit_ns;
    return result;
}

/// Opened before anything moves, so that a stop line that is configured and not there is no surprise later. The tick
/// must outlive it.
std::unique_ptr<StopWatch> watch_stop_line(const Settings& settings, Tick& tick) {
    if (settings.stop_line.chip.empty()) {
        return nullptr;
    }
    return std::make_unique<StopWatch>(open_gpio_stop_line(settings.stop_line), [&tick] { tick.stop_for_good(); });
}

int conclude(const RunOptions& options, const RunResult& result, const Instruments& instruments) {
    if (options.report) {
        write_report(*options.report, make_report(result, instruments));
    }
    std::fputs(summary(result, instruments).c_str(), stdout);
    return result.held() ? 0 : kExitFaulted;
}

/// One run of the loop, or of several one after the other if the device is lost and comes back. Members are in the
/// order in which they have to be there, and go the other way round.
class Run {
  public:
    Run(const RunOptions& options, const Settings& settings, const StopSignals& signals);

    /// Returns when the loop has ended; ends the process if it hangs.
    RunResult execute(Instruments& instruments);

  private:
    /// Loop after loop, until the run is to end or one hangs.
    void run_loops();
    [[nodiscard]] bool may_come_back() const;
    void collect(Instruments& instruments, bool records_ours);
    [[nodiscard]] bool black_box_is_worth_keeping() const;

    const RunOptions& options_;
    const Settings& settings_;
    const StopSignals& signals_;
    RunResult result_;
    StopReason stop_;
    bool hung_ = false;            // the loop does not come back
    bool waited_in_vain_ = false;  // for a device that was lost
    std::int64_t start_ns_ = 0;

    std::unique_ptr<OpenedDevice> device_;
    RingReader<ContactFrame> frames_;
    RingWriter<DeviceState> states_;
    MotorGate gate_;
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

Run::Run(const RunOptions& options, const Settings& settings, const StopSignals& signals)
    : options_(options),
      settings_(settings),
      signals_(signals),
      device_(open_device(options, settings)),
      frames_(options.session),
      states_(options.session),
      gate_(device_->board()),
      tick_(settings.tick, gate_, frames_, states_, &monotonic_now_ns),
      recorder_(options.record ? settings.queue_ticks : 2, options.record ? settings.queue_frames : 2),
      guard_(gate_) {
    device_->follow(tick_);
    if (options.record) {
        record_.emplace(*options.record, recorder_);
        if (options.observer != nullptr) {
            record_->tell([observer = options.observer](const TickRecord& one) { observer->saw(one); });
        }
    }
    prepare_process(prepared_);
    loop_ = std::make_unique<RealtimeLoop>(settings.loop, tick_, prepared_);
    result_.setup = loop_->setup();
    judge_setup(result_.setup, device_->real());
    spdlog::info("session {}: {} Hz on {}; keep the grip still at the centre", options.session,
                 static_cast<double>(kNanosecondsPerSecond) / static_cast<double>(settings.loop.period_ns),
                 device_->description());
    if (const std::string others = describe_other_users(options.session); !others.empty()) {
        spdlog::warn("{}", others);
    }
    watchdog_ = std::make_unique<Watchdog>(watchdog_settings(settings, result_.setup), tick_, gate_);
    stop_watch_ = watch_stop_line(settings, tick_);
    start_ns_ = monotonic_now_ns();
}

bool Run::may_come_back() const {
    const bool lost = (tick_.faults() & HAPTIC_FAULT_EXCHANGE) != 0 && (tick_.faults() & ~kFaultsOfLoss) == 0;
    return lost && (options_.rearm || settings_.rearm) && !gate_.closed();
}

void Run::run_loops() {
    const Watchers watchers{signals_, *watchdog_, stop_watch_.get(), options_.observer};
    while (true) {
        loop_->start(options_.record ? &recorder_ : nullptr);
        hung_ = !supervise(*loop_, watchers, record_, end_of(start_ns_, options_.duration_s), stop_);
        if (hung_) {
            return;
        }
        loop_->join();
        result_.usage += loop_->usage();
        if (!may_come_back()) {
            return;
        }
        waited_in_vain_ = !come_back(*device_, tick_, options_, signals_, start_ns_, result_);
        if (waited_in_vain_) {
            return;
        }
        loop_ = std::make_unique<RealtimeLoop>(settings_.loop, tick_, prepared_);
    }
}

void Run::collect(Instruments& instruments, bool records_ours) {
    result_.duration_s = seconds(monotonic_now_ns() - start_ns_);
    result_.device = device_->description();
    result_.exchange_bound_ns = settings_.tick.exchanges * device_->exchange_bound_ns();
    result_.records_dropped = recorder_.dropped();
    result_.frames_dropped = recorder_.frames_dropped();
    if (records_ours) {
        result_.state = hung_ ? SafetyState::Disarmed : tick_.safety_state();
        result_.faults = tick_.faults();
        result_.suspects = tick_.suspect_strings();
        instruments = tick_.instruments();
    }
    result_.faults |= watchdog_->fired() ? std::uint32_t{HAPTIC_FAULT_WATCHDOG} : 0u;
    if ((result_.faults & HAPTIC_FAULT_STOP) != 0 && std::string_view(stop_.name) == "none") {
        stop_ = {"button", true};
    }
    result_.stop = stop_.name;
}

bool Run::black_box_is_worth_keeping() const {
    // Of a stop that a person asked for too, but not as litter in the folder where the program happens to run.
    return !waited_in_vain_ && (!result_.held() || (stop_.pressed && (options_.report || options_.record)));
}

RunResult Run::execute(Instruments& instruments) {
    run_loops();
    const bool records_ours = !hung_ || tick_.abandon();
    gate_.close();
    collect(instruments, records_ours);
    if (record_) {
        record_->close();
    }
    if (records_ours && black_box_is_worth_keeping()) {
        (void)keep_black_box(options_, tick_, result_.interruptions.size());
    }
    if (hung_) {
        // Its thread cannot be joined, and what it refers to must not be destroyed under it.
        const int status = conclude(options_, result_, instruments);
        std::fflush(nullptr);
        gate_.close();  // for a command that has come through since
        _exit(status);
    }
    return std::move(result_);
}

}  // namespace

int run_command(const RunOptions& options) {
    if (options.device.starts_with("replay:")) {
        return replay_command(options);
    }
    const Config config = load_config(options);
    const Settings settings = read_settings(config);
    if (options.record) {
        write_config_beside(*options.record, config);
    }
    const StopSignals signals;
    const auto instruments = std::make_unique<Instruments>();
    const RunResult result = Run(options, settings, signals).execute(*instruments);
    return conclude(options, result, *instruments);
}

}  // namespace haptic::rt
