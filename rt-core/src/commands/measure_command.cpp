#include "commands/measure_command.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <span>
#include <sstream>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "commands/child_process.hpp"
#include "commands/peer_run.hpp"
#include "commands/run.hpp"
#include "commands/run_files.hpp"
#include "haptic/clock.hpp"
#include "haptic/edge_capture.hpp"
#include "haptic/report.hpp"
#include "haptic/text_file.hpp"
#include "measure/kernel_trace.hpp"
#include "measure/kernel_watch.hpp"
#include "measure/latency_course.hpp"
#include "measure/measure_page.hpp"
#include "measure/measure_report.hpp"
#include "measure/trace_explanation.hpp"
#include "process/idle_request.hpp"
#include "program/exit_status.hpp"

namespace haptic::rt {
namespace {

// Of the kernel's trace around a late tick.
constexpr std::int64_t kTraceBeforeNs = 10'000'000;
constexpr std::int64_t kTraceAfterNs = 100'000;

/// Command of --load; empty for none. Throws Refusal.
std::vector<std::string> load_command(const std::string& load) {
    // Only stress-ng is allowed, so that no arbitrary command is run.
    std::istringstream words(load);
    std::vector<std::string> command;
    for (std::string word; words >> word;) {
        command.push_back(word);
    }
    if (command.size() == 1 && command.front() == "none") {
        return {};
    }
    if (command.empty() || command.front() != "stress-ng") {
        throw Refusal("--load " + load + ": must be none, stress-ng, or \"stress-ng ARGUMENTS\"");
    }
    command.front() = find_program("stress-ng", "stress-ng");
    if (command.size() == 1) {
        // Computation on every processor, memory allocation, disk writes, and messages between processes.
        for (const char* word : {"--cpu", "0", "--vm", "1", "--vm-bytes", "64M", "--io", "1", "--sock", "1"}) {
            command.emplace_back(word);
        }
    }
    return command;
}

/// Starts to capture the edges of the line wired to the tick's probe; nullptr if none is configured. Throws if it
/// cannot be read.
std::unique_ptr<EdgeCapture> capture_loopback(const Settings& settings, EdgeCapture::Take take) {
    if (!settings.probes.loopback) {
        return nullptr;
    }
    return std::make_unique<EdgeCapture>(
        open_edge_source(*settings.probes.loopback, settings.probes.loopback_edges), std::move(take),
        [loop = settings.loop] { (void)prepare_side_thread(loop.priority, loop.cpu); });
}

/// Runs load, capture, kernel counters and peer tools alongside the measured loop.
class Measuring final : public RunHooks {
  public:
    Measuring(const MeasureOptions& options, const Settings& settings);

    [[nodiscard]] TimingLog& log() override { return log_; }
    void on_ready(const RealtimeSetup& setup) override;
    [[nodiscard]] bool on_poll(std::int64_t now_ns) override;
    [[nodiscard]] std::optional<double> segment_s() const override;
    [[nodiscard]] bool on_pause(const StopSignals& signals) override;

    /// Ends load and capture, and returns the report.
    [[nodiscard]] nlohmann::json report(const RunResult& result, const Instruments& instruments);
    /// The kernel's trace around the tick that ended the run; empty if none did. After report().
    [[nodiscard]] const std::string& trace() const noexcept { return trace_lines_; }

  private:
    void end_capture();
    /// The tick that ended the run, explained; null if none did.
    [[nodiscard]] nlohmann::json late_tick(const Instruments& instruments);

    const MeasureOptions& options_;
    const Settings& settings_;
    std::vector<std::string> load_command_;
    std::vector<std::unique_ptr<PeerRun>> peers_;
    TimingLog log_;
    RunCourse course_;
    std::unique_ptr<KernelWatch> kernel_;
    std::unique_ptr<KernelTrace> trace_;  // nullptr: not requested
    bool traces_loop_ = false;            // the trace follows the loop's thread
    std::string trace_lines_;
    int cpu_ = -1;
    std::unique_ptr<ScopedAffinity> off_loop_cpu_;  // keeps this thread off the loop's processor
    std::unique_ptr<ChildProcess> load_;
    EdgeMeter edges_;
    std::unique_ptr<EdgeCapture> capture_;  // feeds edges_; nullptr: not requested
    std::unique_ptr<LoopbackResult> loopback_;
    bool load_ended_ = false;  // the load terminated before the run did
    std::int64_t began_ns_ = 0;
};

Measuring::Measuring(const MeasureOptions& options, const Settings& settings)
    : options_(options),
      settings_(settings),
      load_command_(load_command(options.load)),
      course_(settings.loop.period_ns),
      edges_({.period_ns = settings.loop.period_ns, .kind = settings.probes.loopback_edges}) {
    for (const PeerChoice& choice : chosen_peers(options.peers)) {
        peers_.push_back(std::make_unique<PeerRun>(choice));
        if (!peers_.back()->available()) {
            spdlog::warn("{} is not run: {}", choice.tool->name, peers_.back()->result().missing);
        }
    }
    if (options.break_above_us) {
        log_.break_above(nanoseconds(*options.break_above_us * 1e-6));
        trace_ = std::make_unique<KernelTrace>();
    }
}

void Measuring::on_ready(const RealtimeSetup& setup) {
    cpu_ = setup.cpu;
    kernel_ = std::make_unique<KernelWatch>(cpu_);
    for (const auto& peer : peers_) {
        peer->prepare(setup, settings_.loop.period_ns, options_.alternate_s);
    }
    if (!load_command_.empty()) {
        load_ = std::make_unique<ChildProcess>(load_command_);
        spdlog::info("load: {}", command_text(load_command_));
    }
    capture_ = capture_loopback(settings_, [this](std::span<const Edge> edges) {
        edges_.expect_deadline(log_.a_deadline_ns());
        edges_.add(edges);
    });
    // Only now, so that the load may also run on the loop's processor.
    off_loop_cpu_ = std::make_unique<ScopedAffinity>(cpu_, ScopedAffinity::Change::Exclude);
    began_ns_ = monotonic_now_ns();
    kernel_->restart(began_ns_);
}

bool Measuring::on_poll(std::int64_t now_ns) {
    kernel_->poll(now_ns, log_);
    course_.take(log_);
    if (const std::optional<int> status = load_ && !load_ended_ ? load_->exit_status() : std::nullopt) {
        load_ended_ = true;
        spdlog::warn("the load ended early, with status {}: {}", *status, command_text(load_command_));
    }
    if (!trace_) {
        return true;
    }
    if (!traces_loop_ && log_.thread() != 0) {
        trace_->follow(log_.thread());
        traces_loop_ = true;
    }
    // Stop the trace before newer events push out those of the tick.
    if (log_.broken() != nullptr) {
        trace_->stop();
    }
    return log_.broken() == nullptr;
}

std::optional<double> Measuring::segment_s() const {
    const bool pauses = std::any_of(peers_.begin(), peers_.end(), [](const auto& peer) { return peer->available(); });
    return pauses ? std::optional<double>(options_.alternate_s) : std::nullopt;
}

bool Measuring::on_pause(const StopSignals& signals) {
    kernel_->finish(monotonic_now_ns(), log_);
    course_.take(log_);
    // Same conditions as for the loop: its processor, and the same limit of the idle states.
    off_loop_cpu_.reset();
    const IdleRequest idle(settings_.loop.idle_exit_us);
    const bool go_on = std::all_of(peers_.begin(), peers_.end(), [&](const auto& peer) { return peer->run(signals); });
    off_loop_cpu_ = std::make_unique<ScopedAffinity>(cpu_, ScopedAffinity::Change::Exclude);
    kernel_->restart(monotonic_now_ns());
    return go_on;
}

void Measuring::end_capture() {
    const ProbeLines& lines = settings_.probes;
    if (!capture_ || !lines.loopback) {
        return;
    }
    capture_->stop();
    // Line and capture errors.
    loopback_ = std::make_unique<LoopbackResult>();
    loopback_->line = lines.loopback->line + " of " + lines.loopback->chip;
    loopback_->kind = lines.loopback_edges;
    loopback_->problem = capture_->problem();
    loopback_->edges = edges_.statistics();
}

nlohmann::json Measuring::late_tick(const Instruments& instruments) {
    const TimedTick* const tick = log_.broken();
    if (tick == nullptr) {
        return nullptr;
    }
    const std::int64_t end_ns = tick->deadline_ns + tick->lateness_ns();
    trace_lines_ = trace_->lines(tick->deadline_ns - kTraceBeforeNs, end_ns + kTraceAfterNs);
    const TracedTick traced{.thread = log_.thread(),
                            .cpu = cpu_,
                            .deadline_ns = tick->deadline_ns,
                            .end_ns = end_ns,
                            .usual_ns = instruments.wakeup.percentile_ns(0.5) + instruments.compute.percentile_ns(0.5),
                            .page_faults = tick->usage.page_faults};
    return late_tick_json(*tick, explain_trace(trace_lines_, traced));
}

nlohmann::json Measuring::report(const RunResult& result, const Instruments& instruments) {
    // Stop everything that runs next to the loop before evaluating it.
    kernel_->finish(monotonic_now_ns(), log_);
    course_.take(log_);
    load_.reset();
    end_capture();
    std::vector<MeasuredPeer> peers;
    peers.reserve(peers_.size());
    for (const auto& peer : peers_) {
        peers.push_back({.tool = &peer->tool(), .result = &peer->result()});
    }
    nlohmann::json report = make_measure_report({.result = &result,
                                                 .instruments = &instruments,
                                                 .log = &log_,
                                                 .kernel = kernel_.get(),
                                                 .course = &course_,
                                                 .began_ns = began_ns_,
                                                 .real_minus_monotonic_ns = real_minus_monotonic_ns(),
                                                 .period_ns = settings_.loop.period_ns,
                                                 .load = command_text(load_command_),
                                                 .peers = std::move(peers),
                                                 .loopback = loopback_.get()});
    report["measure"]["load_ended_early"] = load_ended_;
    if (trace_) {
        report["measure"]["break_above_us"] = options_.break_above_us.value_or(0.0);
        report["measure"]["break"] = late_tick(instruments);
    }
    return report;
}

nlohmann::json load_report(const std::filesystem::path& file) {
    std::ifstream stream(file);
    if (!stream) {
        throw std::runtime_error(file.string() + ": cannot be read: " + std::generic_category().message(errno));
    }
    nlohmann::json report;
    try {
        report = nlohmann::json::parse(stream);
    } catch (const nlohmann::json::exception& error) {
        throw std::runtime_error(file.string() + ": is not JSON: " + error.what());
    }
    require_measurement(report, file.string());
    return report;
}

/// What a page without plots says: the command that draws it where gnuplot is.
std::string redraw_text(const MeasureOptions& options) {
    const std::string report = options.from ? options.from->string() : options.run.report.value_or("").string();
    return report.empty() ? "With --report, where it is installed: rt-core measure --from REPORT --html PAGE"
                          : "Where it is installed: rt-core measure --from " + report + " --html " +
                                options.html.value_or("PAGE").string();
}

/// Checks what a command without a run reads and writes.
void require_distinct_reports(const MeasureOptions& options) {
    FileUses files;
    files.reads("--from ", options.from);
    for (const std::filesystem::path& report : options.compare) {
        files.reads("--compare ", report);
    }
    files.writes("--report ", options.run.report);
    files.writes("--html ", options.html);
    files.require_distinct();
}

int measure(const MeasureOptions& options) {
    Config config = load_run_config(options.run);
    if (options.loopback) {
        config.set("probes.loopback=\"" + *options.loopback + "\"");
    }
    // Settings of the run, with --loopback as probes.loopback.
    const Settings settings = read_settings(config);
    FileUses files = files_of_run(options.run);
    add_device_files(files, config);
    files.writes("--html ", options.html);
    files.writes("--trace ", options.trace);
    files.require_distinct();
    if (settings.probes.loopback && !options.peers.empty()) {
        throw Refusal(
            "measure --peers: cannot be combined with probes.loopback, whose line is idle while another tool runs; "
            "measure one after the other");
    }
    // Run with the measurement as hooks; report, page and text are made at the end.
    const StopSignals signals;
    RunOutput output;
    // The device, its guard and the kernel's trace are released before the output is waited for.
    const auto run = [&] {
        Measuring measuring(options, settings);
        const auto conclude = [&](const RunResult& result, const Instruments& instruments, Results& results) {
            const nlohmann::json report = measuring.report(result, instruments);
            if (options.run.report) {
                results.write([&] { write_report(*options.run.report, report); });
            }
            if (options.html) {
                results.write([&] { write_text(*options.html, measure_page(report, redraw_text(options))); });
            }
            if (options.trace && !measuring.trace().empty()) {
                results.write([&] { write_text(*options.trace, measuring.trace()); });
            }
            output.print(measure_text(report));
            return result.succeeded() ? kExitDone : kExitFaulted;
        };
        return Run(options.run, settings, signals, output, &measuring).execute(conclude);
    };
    return output.finish(signals, run());
}

int compare(const MeasureOptions& options) {
    require_distinct_reports(options);
    const nlohmann::json first = load_report(options.compare.at(0));
    const nlohmann::json second = load_report(options.compare.at(1));
    const nlohmann::json comparison = compare_measurements(first, second);
    if (options.run.report) {
        write_report(*options.run.report, comparison);
    }
    if (options.html) {
        const std::string redraw = "Where it is installed: rt-core measure --compare " +
                                   options.compare.at(0).string() + " " + options.compare.at(1).string() + " --html " +
                                   options.html->string();
        write_text(*options.html, comparison_page(first, second, redraw));
    }
    std::fputs(comparison_text(comparison).c_str(), stdout);
    return 0;
}

}  // namespace

int measure_command(const MeasureOptions& options) {
    if (!options.compare.empty()) {
        return compare(options);
    }
    if (options.from && options.run.report) {
        throw std::invalid_argument("--report " + options.run.report->string() +
                                    ": --from shows an existing report and makes no other; leave out --report, or "
                                    "write a page with --html");
    }
    if (options.from) {
        require_distinct_reports(options);
        const nlohmann::json report = load_report(*options.from);
        if (options.html) {
            write_text(*options.html, measure_page(report, redraw_text(options)));
        }
        std::fputs(measure_text(report).c_str(), stdout);
        return kExitDone;
    }
    if (options.run.device.starts_with("replay:")) {
        throw Refusal("measure --device " + options.run.device +
                      ": a replay runs as fast as possible and cannot measure latency; the choices are emulated, usb "
                      "and tty:PATH");
    }
    MeasureOptions measured = options;
    measured.run.duration_s = options.duration_s;
    return measure(measured);
}

}  // namespace haptic::rt
