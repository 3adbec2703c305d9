#include "commands/run.hpp"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>
#include <utility>

#include "commands/black_box_command.hpp"
#include "commands/run_files.hpp"
#include "haptic/clock.hpp"
#include "haptic/other_users.hpp"
#include "measure/recording.hpp"
#include "process/force_profiles.hpp"

namespace haptic::rt {
namespace {

// Interval between two attempts to open a lost device.
constexpr std::int64_t kReopenNs = 200'000'000;
// Faults that a lost device may cause; any other fault ends the run.
constexpr std::uint32_t kDeviceLossFaults = HAPTIC_FAULT_EXCHANGE | HAPTIC_FAULT_OVERRUN;
// Grace period for a hanging loop to recover before the process exits without it.
constexpr std::int64_t kHungWaitNs = 1'000'000'000;
// Time for the rest of the recording, after which the person is told that a signal ends the wait for it.
constexpr std::int64_t kRecordingWaitNs = 1'000'000'000;
// Least watchdog limit, and least window of lateness, with an emulated device, which can hurt nobody: a shared machine
// may stand still for a while.
constexpr std::int64_t kEmulatedWatchdogNs = 2'000'000'000;
constexpr std::int64_t kEmulatedLateWindowNs = 2'000'000'000;

/// Logs what the kernel refused and how to grant it. Throws Refusal for a real device, which a loop that may be late
/// must not drive.
void report_setup(const RealtimeSetup& setup, bool real) {
    for (const MissingPrivilege& one : setup.missing) {
        spdlog::warn("degraded: {}", one.what);
        spdlog::warn("  it needs {}", one.needs);
        spdlog::warn("  {}", one.remedy);
    }
    // Refuse a real device; an emulated one can hurt nobody.
    if (setup.degraded() && real) {
        throw Refusal("a real device is not driven without real-time privileges; the missing ones are listed above");
    }
    if (setup.degraded()) {
        spdlog::warn("continuing because the device is emulated");
    }
}

/// Path of the black box of the nth fault of this run, counted from 0; faults after the first are numbered.
std::filesystem::path fault_box_path(const RunOptions& options, std::size_t nth) {
    return black_box_path(options, nth == 0 ? "fault.csv" : "fault-" + std::to_string(nth + 1) + ".csv");
}

/// The file of the black box; none if it cannot be had, which is worth a warning but no reason not to run.
std::unique_ptr<BlackBoxFile> open_black_box(const RunOptions& options, const Settings& settings) {
    save_left_black_box(options.session);
    const auto ticks = static_cast<std::size_t>(settings.tick.black_box_ns / settings.tick.period_ns);
    try {
        return std::make_unique<BlackBoxFile>(options.session, BlackBox::bytes(ticks),
                                              black_box_path(options, "killed.csv"));
    } catch (const std::runtime_error& error) {
        spdlog::warn("{}; if this process is killed, its last ticks are lost", error.what());
        return nullptr;
    }
}

/// Everything that may end a loop, and the hooks to call meanwhile.
struct StopSources {
    Supervision supervision;
    const StopSignals& signals;
    const Watchdog& watchdog;
    const StopLineMonitor* stop_monitor = nullptr;  // nullptr: no stop line
    const RunObserver* observer = nullptr;          // nullptr: none
};

/// Supervises the loop until it ends: forwards stop requests, and calls `poll` meanwhile. Returns false if the loop
/// hangs for longer than kHungWaitNs.
bool supervise(RealtimeLoop& loop, const StopSources& sources, std::int64_t end_ns, StopReason& reason,
               const std::function<bool()>& poll) {
    bool announced = false;
    bool stopping = false;
    const auto stop = [&](StopReason why) {
        loop.request_stop();
        reason = why;
        stopping = true;
    };
    std::int64_t hung_ns = 0;
    SupervisorCheck supervisors(sources.supervision, std::nullopt);
    const SupervisionPage& page = *sources.supervision.page;
    while (!loop.finished()) {
        // Watchdog: give a hanging loop some time to return.
        if (sources.watchdog.fired() && hung_ns == 0) {
            spdlog::error("watchdog: the loop hangs; the motors were set to zero");
            hung_ns = monotonic_now_ns();
        }
        if (hung_ns != 0 && monotonic_now_ns() - hung_ns > kHungWaitNs) {
            return false;
        }
        // A supervisor that is lost stops the loop by itself; say which.
        supervisors.check(monotonic_now_ns());
        if (page.has_lost() && !stopping) {
            spdlog::error("stopping: lost a supervisor of the loop: {}", supervisor_names(page.lost.load()));
            stop({"supervision", false});
        }
        // Stop requests: a signal, the end of the duration or an observer; then the stop line.
        const int signal = sources.signals.wait(StopSignals::kPollNs);
        const bool over = monotonic_now_ns() >= end_ns || (sources.observer != nullptr && sources.observer->done());
        if ((signal != 0 || over) && !stopping) {
            // The tick fades out; the loop ends when it is disarmed.
            spdlog::info("stopping: {}", signal != 0 ? "signal received" : "end of the run");
            stop({signal != 0 ? "signal" : "duration", signal != 0});
        }
        if (sources.stop_monitor != nullptr && sources.stop_monitor->stopped() && !stopping) {
            spdlog::warn("stopping: {}", sources.stop_monitor->reason());
            stop({"line", true});  // ends a loop that still awaits a person, too
        }
        if (!announced && loop.safety_state() == SafetyState::Running) {
            spdlog::info("running");
            announced = true;
        }
        if (!poll() && !stopping) {
            spdlog::info("stopping: late tick");
            stop({"late tick", false});
        }
    }
    return true;
}

/// Tries to reopen a lost device until it is back, and calls `poll` meanwhile; false if a signal or the end of the run
/// comes first.
bool wait_for_device(OpenedDevice& device, const StopSignals& signals, std::int64_t end_ns,
                     const std::function<void()>& poll) {
    spdlog::warn("waiting for {} to come back; Ctrl-C ends the run", device.description());
    std::string problem;
    while (true) {
        // reopen() throws until the device is connected again.
        try {
            device.reopen();
            spdlog::info("{} is back, with its motors at zero", device.description());
            return true;
        } catch (const device::BoardError& error) {
            // Log each problem once, not at every attempt.
            if (problem != error.what()) {
                problem = error.what();
                spdlog::info("not yet: {}", problem);
            }
        }
        poll();
        if (signals.wait(kReopenNs) != 0 || monotonic_now_ns() >= end_ns) {
            spdlog::info("stopping: the device did not come back");
            return false;
        }
    }
}

/// Where the period goes with this device.
PeriodDemand period_demand(const OpenedDevice& device, const Settings& settings) {
    PeriodDemand demand = device.demand();
    demand.exchanges = settings.tick.exchanges;
    demand.period_ns = settings.loop.period_ns;
    return demand;
}

/// Logs the budget of the period. Throws Refusal for a period that cannot hold it.
void report_period_budget(const PeriodBudget& budget) {
    if (budget.verdict() == PeriodVerdict::TooShort) {
        throw Refusal("loop.period_s: " + describe_shortage(budget) +
                      ". What would hold: " + describe_remedies(budget));
    }
    std::istringstream lines(text_of(budget));
    for (std::string line; std::getline(lines, line);) {
        spdlog::info("{}", line);
    }
    if (budget.verdict() == PeriodVerdict::Tight) {
        spdlog::warn("{}; it would hold with {}", describe_shortage(budget), describe_remedies(budget));
    }
}

TickSettings tick_settings(const Settings& settings, bool real) {
    // Nobody has signed for this device: commissioning mode.
    TickSettings result = real && !settings.protocol.holds() ? commissioning(settings.tick) : settings.tick;
    if (!real) {
        result.safety.late_window_ns = std::max(result.safety.late_window_ns, kEmulatedLateWindowNs);
    }
    result.safety.prove = settings.prove == Prove::Always || (real && settings.prove == Prove::RealDevice);
    return result;
}

/// Says how much a real device renders, and why.
void report_protocol(const DeviceProtocol& protocol) {
    if (protocol.holds()) {
        spdlog::info("the protocol of this device was signed by {} on {}", protocol.person, protocol.date);
        return;
    }
    spdlog::warn("commissioning mode: at most {} N, because {}", kCommissioningForce, protocol.lacks);
    spdlog::warn("  rt-core bringup measures the device and writes a protocol to sign");
}

WatchdogSettings watchdog_settings(const Settings& settings, const RealtimeSetup& setup, bool real) {
    WatchdogSettings result = settings.watchdog;
    // The processor that the loop was granted.
    result.loop_cpu = setup.cpu >= 0 ? setup.cpu : settings.loop.cpu;
    result.limit_ns = real ? result.limit_ns : std::max(result.limit_ns, kEmulatedWatchdogNs);
    return result;
}

/// Says that a supervisor may be late when the machine is busy.
void warn_if_ordinary(const char* name, int priority) {
    if (priority == 0) {
        spdlog::warn("degraded: the {} is not scheduled in real time and may be late on a busy machine", name);
    }
}

/// Opens the configured stop line before anything moves, so that a missing line is reported at once. The tick must
/// outlive the monitor.
std::unique_ptr<StopLineMonitor> open_stop_monitor(const Settings& settings, Tick& tick, const StopLineThread& thread) {
    if (settings.stop_line.chip.empty()) {
        return nullptr;
    }
    return std::make_unique<StopLineMonitor>(
        open_gpio_stop_line(settings.stop_line), [&tick] { tick.stop_for_good(); }, thread);
}

}  // namespace

void set_for_device(Config& config, const Settings& settings, bool real) {
    const SafetySettings safety = tick_settings(settings, real).safety;
    config.set(std::string("safety.prove=\"") + (safety.prove ? "always" : "never") + "\"");
    config.set("safety.late_window_s=" + std::to_string(seconds(safety.late_window_ns)));
}

Run::Run(const RunOptions& options, const Settings& settings, const StopSignals& signals, const RunOutput& output,
         RunHooks* hooks)
    : options_(options),
      settings_(settings),
      signals_(signals),
      output_(output),
      hooks_(hooks),
      person_arms_(settings.person_arms),
      device_(open_device(options, settings)),
      frames_(options.session),
      frame_source_(frames_),
      states_(options.session),
      arm_inputs_(options.session, person_, settings.loop.arm_button),
      black_box_file_(open_black_box(options, settings)),
      gate_(device_->board()),
      probes_(open_tick_probes(settings.probes, &monotonic_now_ns)),
      tick_(tick_settings(settings, device_->is_real()), gate_, frame_source_, states_, &monotonic_now_ns),
      guard_(gate_) {
    // A period that cannot hold its exchanges is refused before anything moves.
    const PeriodBudget period_budget = budget_of(period_demand(*device_, settings));
    report_period_budget(period_budget);
    result_.period = period_budget.demand;
    // The region of the walls for the view; one that a killed process left is not this run's.
    std::filesystem::remove(region_path(options.session));
    if (settings.tick.walls.on) {
        region_.emplace(options.session, WorkspaceRegion{settings.tick.walls.semi_axes, settings.tick.walls.angle});
    }
    // Outputs and inputs of the tick: overlays, probes, the device's hooks, the black box, and the recording.
    if (settings.tick.overlay.on()) {
        overlays_.emplace(overlay_ring_.emplace(options.session));
        tick_.overlay_from(&*overlays_);
    }
    if (settings.probes.tick || settings.probes.frame || settings.probes.relay) {
        tick_.show_on(&probes_);
    }
    if (black_box_file_) {
        tick_.keep_black_box_in(black_box_file_->memory());
    }
    gate_.obey(shared_.page().cut);
    device_->attach(tick_);
    if (options.record) {
        RecordingSettings recording{*options.record, settings.queue_ticks, settings.queue_frames};
        if (options.observer != nullptr) {
            recording.observer = [observer = options.observer](const TickRecord& tick) { observer->on_tick(tick); };
        }
        recording_ = std::make_unique<RecordingThread>(recording);
    }
    // Everything large is allocated: lock memory, and create the threads of frames and of the loop.
    prepare_process(prepared_);
    frame_thread_.emplace(FrameThreadSettings{.period_ns = settings.loop.period_ns,
                                              .priority = settings.loop.priority - 1,
                                              .loop_cpu = settings.loop.cpu},
                          frame_source_);
    tick_.take_frames_from(*frame_thread_);
    loop_ = std::make_unique<RealtimeLoop>(settings.loop, tick_, prepared_, &shared_.page());
    if (device_->is_real() && settings.profile.empty()) {
        throw Refusal("a real device needs a profile of forces: safety.profile must not be empty");
    }
    // The loop's thread is prepared and waits; report what it was granted.
    result_.setup = loop_->setup();
    report_setup(result_.setup, device_->is_real());
    if (device_->is_real()) {
        report_protocol(settings.protocol);
    }
    spdlog::info("session {}: {} Hz on {}{}", options.session,
                 static_cast<double>(kNanosecondsPerSecond) / static_cast<double>(settings.loop.period_ns),
                 device_->description(), person_arms_ ? "" : "; hold the grip still at the centre");
    if (!settings.profile.empty()) {
        spdlog::info("{}", describe_limits(settings.profile, tick_settings(settings, device_->is_real())));
    }
    if (settings.tick.overlay.on()) {
        spdlog::info("takes a wrench overlay of at most {} N and {} N*m through rt-core relay",
                     settings.tick.overlay.max_force, settings.tick.overlay.max_torque);
    }
    // A second session may disturb this one.
    if (const std::string others = describe_other_users(options.session); !others.empty()) {
        spdlog::warn("{}", others);
    }
    // Ready, but nothing moves before start().
    if (hooks_ != nullptr) {
        hooks_->on_ready(result_.setup);
    }
    start_supervisors();
    start_ns_ = monotonic_now_ns();
}

Run::~Run() {
    // After an exception the motors come first.
    loop_.reset();
    finish_recording();
}

void Run::finish_recording() {
    if (!recording_) {
        return;
    }
    recording_->finish();
    const std::string file = options_.record.value_or("").string();
    const std::int64_t patient_until_ns = monotonic_now_ns() + kRecordingWaitNs;
    bool announced = false;
    while (!recording_->finished()) {
        const bool signalled = signals_.wait(StopSignals::kPollNs) != 0;
        if (announced && signalled) {
            // Its thread is blocked. That, and all it uses, is left as it is until the process ends.
            [[maybe_unused]] const RecordingThread* const left = recording_.release();
            results_.write([&file] { throw std::runtime_error(file + ": its end is missing"); });
            return;
        }
        if (!announced && monotonic_now_ns() >= patient_until_ns) {
            spdlog::warn("the motors are at zero; waiting for {} to take the rest of the recording; Ctrl-C ends that",
                         file);
            announced = true;
        }
    }
    results_.write([this] { recording_->require_complete(); });
}

bool Run::lost_device() const {
    return loop_->lost() ||
           ((tick_.faults() & HAPTIC_FAULT_EXCHANGE) != 0 && (tick_.faults() & ~kDeviceLossFaults) == 0);
}

Supervision Run::supervision() const {
    const WatchdogSettings watchdog = watchdog_settings(settings_, result_.setup, device_->is_real());
    return {&shared_.page(), watchdog.limit_ns + watchdog.limit_ns / 2};
}

void Run::start_supervisors() {
    const WatchdogSettings watchdog = watchdog_settings(settings_, result_.setup, device_->is_real());
    const Supervision shared = supervision();
    SupervisionResult& result = result_.supervision;
    if (device_->is_real()) {
        GuardSettings guard = settings_.guard;
        guard.loop_cpu = watchdog.loop_cpu;
        guard.lost_ns = shared.limit_ns;
        guard.silence_ns = guard_silence_ns(guard.silence_ns, settings_.tick.exchanges * device_->exchange_bound_ns(),
                                            settings_.loop.period_ns);
        try {
            guard_link_ = std::make_unique<GuardLink>(guard, shared_, device_->board().zero_packet(),
                                                      black_box_file_ ? black_box_file_->descriptor() : -1);
        } catch (const std::runtime_error& error) {
            throw Refusal(error.what());
        }
        const GuardGrant& grant = guard_link_->grant();
        result.guarded = true;
        result.guard_priority = grant.priority;
        result.guard_oom_score_adj = grant.oom_score_adj;
        result.guard_locked = grant.memory_locked;
        result.silence_ns = guard.silence_ns;
        warn_if_ordinary("guard", grant.priority);
    }
    watchdog_ = std::make_unique<Watchdog>(watchdog, tick_, gate_, shared);
    result.watchdog_priority = watchdog_->priority();
    warn_if_ordinary("watchdog", result.watchdog_priority);
    stop_monitor_ = open_stop_monitor(settings_, tick_, {watchdog.priority, watchdog.loop_cpu, shared});
    if (stop_monitor_) {
        result.stop_line_priority = stop_monitor_->priority();
        warn_if_ordinary("stop line", result.stop_line_priority);
    }
}

bool Run::renew_guard() {
    if (!guard_link_) {
        return true;
    }
    try {
        guard_link_->renew(device_->board().zero_packet());
        return true;
    } catch (const std::runtime_error& error) {
        spdlog::error("stopping: {}", error.what());
        shared_.page().lost.fetch_or(1U << static_cast<unsigned>(Supervisor::Guard));
        return false;
    }
}

bool Run::can_recover() const {
    // A stop may have been taken while the loop was already ending by the loss; nobody would ask for it again.
    const bool stopped = std::string_view(stop_.name) != "none";
    return lost_device() && (options_.reconnect || settings_.reconnect) && !stopped && !gate_.closed();
}

std::int64_t Run::end_ns() const {
    return options_.duration_s ? start_ns_ + paused_ns_ + nanoseconds(*options_.duration_s)
                               : std::numeric_limits<std::int64_t>::max();
}

void Run::run_loops() {
    if (options_.duration_s) {
        progress_.emplace("running");
    }
    while (run_loop() && continue_after_loop()) {
        loop_ = std::make_unique<RealtimeLoop>(settings_.loop, tick_, prepared_, &shared_.page());
    }
    progress_.reset();
}

bool Run::run_loop() {
    const StopSources sources{supervision(), signals_, *watchdog_, stop_monitor_.get(), options_.observer};
    // This loop ends with the run or with the current segment.
    std::int64_t until_ns = end_ns();
    if (const auto segment_s = hooks_ != nullptr ? hooks_->segment_s() : std::nullopt) {
        until_ns = std::min(until_ns, monotonic_now_ns() + nanoseconds(*segment_s));
    }
    // Start the loop and supervise it to its end.
    stop_ = StopReason{};
    loop_->start(recording_ ? &recording_->recorder() : nullptr, hooks_ != nullptr ? &hooks_->log() : nullptr,
                 person_arms_ ? &person_ : nullptr);
    hung_ = !supervise(*loop_, sources, until_ns, stop_, [this] { return poll(); });
    if (hung_) {
        return false;
    }
    // Normal end: the thread is gone, and its usage is complete.
    loop_->join();
    result_.usage += loop_->usage();
    return true;
}

bool Run::poll() {
    const std::int64_t now_ns = monotonic_now_ns();
    poll_arming();
    if (!budget_warned_ && (loop_->flags() & HAPTIC_TICK_BUDGET_LOW) != 0) {
        spdlog::warn(
            "80 % of the session's budget of energy or time is used; at 100 % the force fades and the run ends");
        budget_warned_ = true;
    }
    if (progress_ && options_.duration_s) {
        progress_->show(seconds(now_ns - start_ns_ - paused_ns_) / *options_.duration_s);
    }
    return hooks_ == nullptr || hooks_->on_poll(now_ns);
}

void Run::poll_arming() {
    if (person_.awaited() && !person_awaited_) {
        person_awaited_ = true;
        arm_inputs_.begin();
        spdlog::warn("disarmed until a person arms the device: {}", arm_inputs_.instructions());
    }
    const SafetyState state = loop_->safety_state();
    arm_inputs_.poll(person_.awaited()                ? "disarmed; a person must arm the device"
                     : state == SafetyState::Disarmed ? "disarmed; not ready to be armed"
                                                      : "already armed: " + std::string(state_name(state)));
    if (person_awaited_ && person_.pressed()) {
        person_awaited_ = false;
        spdlog::info("armed by a person ({}); hold the grip still at the centre", describe(person_.by()));
        result_.armings.push_back({seconds(monotonic_now_ns() - start_ns_ - paused_ns_), describe(person_.by())});
    }
}

bool Run::continue_after_loop() {
    if (can_recover()) {
        device_not_recovered_ = !recover_device();
        return !device_not_recovered_;
    }
    return pause_due() && pause() && monotonic_now_ns() < end_ns();
}

bool Run::recover_device() {
    const std::int64_t lost_ns = monotonic_now_ns();
    // Record the loss and keep its black box before the next loop overwrites it.
    Interruption interruption;
    interruption.at_s = seconds(lost_ns - start_ns_ - paused_ns_);
    interruption.faults = tick_.faults() | HAPTIC_FAULT_EXCHANGE;
    interruption.cause = loop_->lost().value_or(tick_.instruments().last_failure);
    interruption.black_box = keep_black_box();
    // Wait, and record how long the loss lasted.
    const bool back = wait_for_device(*device_, signals_, end_ns(),
                                      [this] { arm_inputs_.poll("disarmed; the device is not connected"); }) &&
                      renew_guard();
    // Strings that pull again without a person who expects it may hurt.
    person_arms_ = true;
    person_awaited_ = false;
    interruption.lost_s = seconds(monotonic_now_ns() - lost_ns);
    result_.interruptions.push_back(std::move(interruption));
    return back;
}

bool Run::pause_due() const {
    // A segment that ended for any other reason than its duration ends the run.
    return hooks_ != nullptr && hooks_->segment_s() && std::string_view(stop_.name) == "duration" &&
           tick_.faults() == HAPTIC_FAULT_STOP && !gate_.closed();
}

bool Run::pause() {
    const std::int64_t begin_ns = monotonic_now_ns();
    const bool go_on = hooks_->on_pause(signals_);
    paused_ns_ += monotonic_now_ns() - begin_ns;
    return go_on;
}

void Run::collect(Instruments& instruments, bool own_records) {
    // Results that do not come from the tick: times, device, dropped records.
    result_.duration_s = seconds(monotonic_now_ns() - start_ns_ - paused_ns_);
    result_.device = device_->description();
    result_.geometry = settings_.tick.geometry;
    result_.profile = settings_.profile;
    result_.limits = tick_settings(settings_, device_->is_real()).limits;  // commissioning lowers them
    result_.budget_limits = settings_.tick.budget;
    result_.walls = settings_.tick.walls;
    result_.exchange_bound_ns = settings_.tick.exchanges * device_->exchange_bound_ns();
    if (recording_) {
        result_.records_dropped = recording_->recorder().dropped();
        result_.frames_dropped = recording_->recorder().frames_dropped();
    }
    // The tick's own records, unless a hanging loop may still write to them.
    if (own_records) {
        result_.state = hung_ ? SafetyState::Disarmed : tick_.safety_state();
        result_.faults = tick_.faults();
        result_.suspects = tick_.suspect_strings();
        result_.proof = tick_.proof();
        result_.probes = use_of(probes_, settings_.probes, tick_.last().number);
        instruments = tick_.instruments();
        result_.budget = tick_.budget();
    }
    result_.faults |= loop_->lost() ? std::uint32_t{HAPTIC_FAULT_EXCHANGE} : 0u;
    collect_supervision();
    result_.faults |= watchdog_->fired() ? std::uint32_t{HAPTIC_FAULT_WATCHDOG} : 0u;
    // A stop without any other origin came from a button of the device.
    if ((result_.faults & HAPTIC_FAULT_STOP) != 0 && std::string_view(stop_.name) == "none") {
        stop_ = {"button", true};
    }
    result_.stop = stop_.name;
}

void Run::collect_supervision() {
    const SupervisionPage& page = shared_.page();
    result_.supervision.lost = supervisor_names(page.lost.load());
    result_.supervision.frozen_ns = page.frozen_ns.load();
    if (page.is_cut()) {
        spdlog::error("the guard set the motors to zero: the loop was silent for {:.1f} ms",
                      static_cast<double>(result_.supervision.frozen_ns) * 1e-6);
    }
    result_.faults |= page.is_cut() || page.has_lost() ? std::uint32_t{HAPTIC_FAULT_GUARD} : 0u;
}

bool Run::should_keep_black_box() const {
    // After a fault always; after a stop by a person only if the user named an output file, so that a plain run does
    // not leave files in the working directory.
    return !device_not_recovered_ && (!result_.succeeded() || (stop_.pressed && (options_.report || options_.record)));
}

std::string Run::keep_black_box() {
    std::filesystem::path box = fault_box_path(options_, result_.interruptions.size());
    std::string kept;
    results_.write([&] {
        // The last ticks of a fault are worth a second place.
        try {
            write_black_box(box, tick_.black_box());
        } catch (const std::runtime_error& error) {
            spdlog::warn("{}", error.what());
            box = std::filesystem::temp_directory_path() / box.filename();
            write_black_box(box, tick_.black_box());
        }
        kept = box.string();
        // A requested stop is no error.
        const bool fault = (tick_.faults() & ~std::uint32_t{HAPTIC_FAULT_STOP}) != 0;
        spdlog::log(fault ? spdlog::level::err : spdlog::level::info, "{}: the last {} ticks are in {}",
                    fault ? "faulted" : "stopped", tick_.black_box().size(), kept);
    });
    return kept;
}

int Run::execute(const Conclusion& conclude) {
    const auto instruments = std::make_unique<Instruments>();
    // Run, with pauses and recoveries in between.
    if (!person_arms_) {
        result_.armings.push_back({0.0, "start"});
    }
    run_loops();
    // From here on the motors stay at zero, whatever a hanging loop may still send.
    const bool own_records = !hung_ || tick_.abandon();
    gate_.close();
    collect(*instruments, own_records);
    // Keep the last ticks where they matter.
    if (own_records && should_keep_black_box()) {
        (void)keep_black_box();
    }
    // Write the report, then the rest of the recording, for which it may take a signal to end. Both determine the exit
    // status.
    const int of_run = conclude(result_, *instruments, results_);
    finish_recording();
    const int status = results_.status(of_run);
    for (const std::string& problem : results_.problems()) {
        spdlog::error("{}", problem);
    }
    if (hung_) {
        // The loop's thread cannot be joined, and the objects it uses must not be destroyed under it.
        gate_.close();  // overrides a command that was under way at the first close()
        // If this thread could not read the last ticks, the guard or the next run of the session saves them.
        if (own_records && black_box_file_) {
            shared_.page().black_box_kept.store(1);
            black_box_file_->remove();
        }
        output_.leave(status);
    }
    return status;
}

}  // namespace haptic::rt
