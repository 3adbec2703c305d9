#include "commands/run.hpp"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include <haptic/clock.hpp>
#include <haptic/other_users.hpp>

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

/// What may end a run.
struct Watchers {
    const StopSignals& signals;
    const Watchdog& watchdog;
    const StopWatch* stop_watch;  // nullptr: no stop line
    const RunObserver* observer;  // nullptr: none
    RunCompanion* companion;      // nullptr: none
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
        if (watchers.companion != nullptr) {
            watchers.companion->look(monotonic_now_ns());
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

}  // namespace

StopSignals::StopSignals() {
    sigemptyset(&set_);
    for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGTSTP}) {
        sigaddset(&set_, signal);
    }
    for (const int signal : {SIGPIPE, SIGTTIN, SIGTTOU}) {
        std::signal(signal, SIG_IGN);
    }
    pthread_sigmask(SIG_BLOCK, &set_, nullptr);
}

int StopSignals::wait(std::int64_t at_most_ns) const {
    const timespec time{at_most_ns / kNanosecondsPerSecond, at_most_ns % kNanosecondsPerSecond};
    const int signal = sigtimedwait(&set_, nullptr, &time);
    return signal > 0 ? signal : 0;  // EAGAIN and EINTR: none yet
}

Config load_config(const RunOptions& options) {
    Config config = options.config ? Config::load(*options.config) : Config();
    for (const std::string& assignment : options.assignments) {
        config.set(assignment);
    }
    return config;
}

Run::Run(const RunOptions& options, const Settings& settings, const StopSignals& signals, RunCompanion* companion)
    : options_(options),
      settings_(settings),
      signals_(signals),
      companion_(companion),
      device_(open_device(options, settings)),
      frames_(options.session),
      states_(options.session),
      gate_(device_->board()),
      probes_(open_tick_probes(settings.probes, &monotonic_now_ns)),
      tick_(settings.tick, gate_, frames_, states_, &monotonic_now_ns),
      recorder_(options.record ? settings.queue_ticks : 2, options.record ? settings.queue_frames : 2),
      guard_(gate_) {
    if (settings.probes.tick || settings.probes.frame) {
        tick_.show_on(&probes_);
    }
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
    if (companion_ != nullptr) {
        companion_->begin(result_.setup);
    }
    watchdog_ = std::make_unique<Watchdog>(watchdog_settings(settings, result_.setup), tick_, gate_);
    stop_watch_ = watch_stop_line(settings, tick_);
    start_ns_ = monotonic_now_ns();
}

bool Run::may_come_back() const {
    const bool lost = (tick_.faults() & HAPTIC_FAULT_EXCHANGE) != 0 && (tick_.faults() & ~kFaultsOfLoss) == 0;
    return lost && (options_.rearm || settings_.rearm) && !gate_.closed();
}

std::int64_t Run::end_ns() const {
    return options_.duration_s ? start_ns_ + paused_ns_ + nanoseconds(*options_.duration_s)
                               : std::numeric_limits<std::int64_t>::max();
}

void Run::run_loops() {
    while (run_loop() && go_on_after_loop()) {
        loop_ = std::make_unique<RealtimeLoop>(settings_.loop, tick_, prepared_);
    }
}

bool Run::run_loop() {
    const Watchers watchers{signals_, *watchdog_, stop_watch_.get(), options_.observer, companion_};
    std::int64_t until_ns = end_ns();
    if (const auto stretch_s = companion_ != nullptr ? companion_->stretch_s() : std::nullopt) {
        until_ns = std::min(until_ns, monotonic_now_ns() + nanoseconds(*stretch_s));
    }
    stop_ = StopReason{};
    loop_->start(options_.record ? &recorder_ : nullptr, companion_ != nullptr ? &companion_->log() : nullptr);
    hung_ = !supervise(*loop_, watchers, record_, until_ns, stop_);
    if (hung_) {
        return false;
    }
    loop_->join();
    result_.usage += loop_->usage();
    return true;
}

bool Run::go_on_after_loop() {
    if (may_come_back()) {
        waited_in_vain_ = !come_back();
        return !waited_in_vain_;
    }
    return pause_is_due() && pause() && monotonic_now_ns() < end_ns();
}

bool Run::come_back() {
    const std::int64_t lost_ns = monotonic_now_ns();
    Interruption interruption;
    interruption.at_s = seconds(lost_ns - start_ns_ - paused_ns_);
    interruption.faults = tick_.faults();
    interruption.cause = tick_.instruments().last_failure;
    interruption.black_box = keep_black_box(options_, tick_, result_.interruptions.size());
    const bool back = wait_until_back(*device_, signals_, end_ns());
    interruption.lost_s = seconds(monotonic_now_ns() - lost_ns);
    result_.interruptions.push_back(std::move(interruption));
    return back;
}

bool Run::pause_is_due() const {
    // Whatever else ended the loop ends the run.
    return companion_ != nullptr && companion_->stretch_s() && std::string_view(stop_.name) == "duration" &&
           tick_.faults() == HAPTIC_FAULT_STOP && !gate_.closed();
}

bool Run::pause() {
    const std::int64_t begin_ns = monotonic_now_ns();
    const bool go_on = companion_->pause(signals_);
    paused_ns_ += monotonic_now_ns() - begin_ns;
    return go_on;
}

void Run::collect(Instruments& instruments, bool records_ours) {
    result_.duration_s = seconds(monotonic_now_ns() - start_ns_ - paused_ns_);
    result_.device = device_->description();
    result_.exchange_bound_ns = settings_.tick.exchanges * device_->exchange_bound_ns();
    result_.records_dropped = recorder_.dropped();
    result_.frames_dropped = recorder_.frames_dropped();
    if (records_ours) {
        result_.state = hung_ ? SafetyState::Disarmed : tick_.safety_state();
        result_.faults = tick_.faults();
        result_.suspects = tick_.suspect_strings();
        result_.probes = use_of(probes_, settings_.probes, tick_.last().number);
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

int Run::execute(const Conclusion& conclude) {
    const auto instruments = std::make_unique<Instruments>();
    run_loops();
    const bool records_ours = !hung_ || tick_.abandon();
    gate_.close();
    collect(*instruments, records_ours);
    if (record_) {
        record_->close();
    }
    if (records_ours && black_box_is_worth_keeping()) {
        (void)keep_black_box(options_, tick_, result_.interruptions.size());
    }
    const int status = conclude(result_, *instruments);
    if (hung_) {
        // Its thread cannot be joined, and what it refers to must not be destroyed under it.
        std::fflush(nullptr);
        gate_.close();  // for a command that has come through since
        _exit(status);
    }
    return status;
}

}  // namespace haptic::rt
