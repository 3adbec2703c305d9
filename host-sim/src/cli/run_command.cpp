// host-sim run: a scene from its start to its end, under a virtual clock or the real one.

#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <csignal>
#include <ctime>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "cli/commands.hpp"
#include "cli/hand.hpp"
#include "cli/run_statistics.hpp"
#include "cli/snapshots.hpp"
#include "cli/workspace_file.hpp"
#include "haptic/clock.hpp"
#include "haptic/config.hpp"
#include "haptic/other_users.hpp"
#include "haptic/pose_track.hpp"
#include "haptic/probe.hpp"
#include "haptic/report.hpp"
#include "haptic/ring.hpp"
#include "haptic/sim/curl_track.hpp"
#include "haptic/sim/hostile_hand.hpp"
#include "haptic/sim/scene.hpp"
#include "haptic/sim/simulation.hpp"

namespace haptic::sim {
namespace {

volatile std::sig_atomic_t stop_requested = 0;

void request_stop(int /*signal*/) {
    stop_requested = 1;
}

/// While it lives, SIGINT, SIGTERM and SIGHUP end the run in an orderly way instead of the process.
class StopOnSignal {
  public:
    StopOnSignal() {
        struct sigaction action{};
        action.sa_handler = request_stop;  // without SA_RESTART: the sleep of the run ends at once
        (void)sigaction(SIGINT, &action, &old_interrupt_);
        (void)sigaction(SIGTERM, &action, &old_terminate_);
        (void)sigaction(SIGHUP, &action, &old_hangup_);
    }
    StopOnSignal(const StopOnSignal&) = delete;
    StopOnSignal& operator=(const StopOnSignal&) = delete;
    ~StopOnSignal() {
        (void)sigaction(SIGINT, &old_interrupt_, nullptr);
        (void)sigaction(SIGTERM, &old_terminate_, nullptr);
        (void)sigaction(SIGHUP, &old_hangup_, nullptr);
    }

  private:
    struct sigaction old_interrupt_{};
    struct sigaction old_terminate_{};
    struct sigaction old_hangup_{};
};

struct RunOptions {
    std::string scene;
    std::vector<std::string> assignments;
    std::string session;
    std::optional<double> duration_s;
    std::optional<std::uint64_t> steps;
    std::string clock = "lockstep";
    std::string input;
    std::string hand = "script";
    std::string report;
    std::string record;
    std::string snapshots;
    std::string workspace;
    double wait_s = 0.0;
    bool verify = false;
};

void sleep_until(std::int64_t time_ns) {
    const timespec deadline{static_cast<std::time_t>(time_ns / kNanosecondsPerSecond),
                            static_cast<long>(time_ns % kNanosecondsPerSecond)};
    while (stop_requested == 0 && clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &deadline, nullptr) == EINTR) {
    }
}

/// What has to be known before a run can be set up. Throws for whatever is wrong with the options.
struct Plan {
    explicit Plan(const RunOptions& options);

    Scene scene;
    std::uint64_t steps = 0;  // 0: until stopped
    bool real = false;
    std::optional<std::uint64_t> hostile_seed;  // none: the hand is not hostile
    std::string session;                        // of the rings; empty: none are used
    std::shared_ptr<WorkspaceFile> workspace;   // null: that of the scene
};

/// Finds out before a long run, not after it, that a result could not be written.
void require_folder_of(const std::string& file) {
    const std::filesystem::path folder = std::filesystem::path(file).parent_path();
    if (!folder.empty() && !std::filesystem::is_directory(folder)) {
        throw std::runtime_error(file + ": the folder " + folder.string() + " does not exist");
    }
}

// m/s; a fast human hand
constexpr double kHostileSpeed = 5.0;
// rad/s; faster than a wrist, with a whole turn in less than half a second
constexpr double kHostileTurn = 15.0;

/// The seed in "hostile:SEED", 1 in "hostile", none in "script". Throws for anything else.
std::optional<std::uint64_t> hostile_seed_of(const std::string& hand) {
    constexpr std::string_view hostile = "hostile";
    if (hand == "script") {
        return std::nullopt;
    }
    if (hand == hostile) {
        return 1;
    }
    const std::string_view text(hand);
    std::uint64_t seed = 0;
    if (text.starts_with(hostile) && text.size() > hostile.size() + 1 && text[hostile.size()] == ':') {
        const auto [end, error] = std::from_chars(text.data() + hostile.size() + 1, text.data() + text.size(), seed);
        if (error == std::errc() && end == text.data() + text.size()) {
            return seed;
        }
    }
    throw std::runtime_error("--hand " + hand + ": must be script, hostile, or hostile:SEED with a whole number SEED");
}

Plan::Plan(const RunOptions& options) {
    require_folder_of(options.report);
    require_folder_of(options.record);
    Config config = open_scene(options.scene);
    for (const std::string& assignment : options.assignments) {
        config.set(assignment);
    }
    const std::filesystem::path path(options.scene);
    scene = read_scene(config, path.extension() == ".toml" ? path.stem().string() : options.scene);
    if (!options.workspace.empty()) {
        workspace = std::make_shared<WorkspaceFile>(options.workspace, scene.workspace);
        scene.workspace = workspace->settings();
    }
    const double duration_s = options.duration_s.value_or(scene.duration_s);
    steps = options.steps.value_or(static_cast<std::uint64_t>(std::llround(duration_s / scene.solver.step)));
    real = options.clock == "real";
    hostile_seed = hostile_seed_of(options.hand);
    if (hostile_seed && (real || !options.input.empty())) {
        throw std::runtime_error("--hand hostile: goes with --clock lockstep and without --input");
    }
    session = real && options.session.empty() ? "default" : options.session;
}

// Steps for which a run without an end reserves memory.
constexpr std::uint64_t kRoomAtLeast = 100'000;
// How often a waiting run looks for the device.
constexpr std::int64_t kLookEveryNs = 1'000'000;

class Run {
  public:
    explicit Run(const RunOptions& options) : Run(options, Plan(options)) {}
    int go();

  private:
    Run(const RunOptions& options, const Plan& plan);
    void run_lockstep();
    void run_real(RingReader<DeviceState>& states);
    void wait_for_device(DeviceHand& hand);
    void follow_input(StepInput& input, std::int64_t time_ns) const;
    void one_step(const StepInput& input);
    void follow_workspace(std::int64_t now_ns);
    [[nodiscard]] bool wanted() const { return stop_requested == 0 && (steps_ == 0 || statistics_.steps() < steps_); }
    [[nodiscard]] nlohmann::json probe_report() const;
    void write_results(double wall_s) const;

    const StopOnSignal stop_;  // first: from before there are rings until after there are none
    const RunOptions& options_;
    std::uint64_t steps_;  // 0: until stopped
    Simulation simulation_;
    RunStatistics statistics_;
    std::unique_ptr<Snapshots> snapshots_;
    std::unique_ptr<PoseTrack> input_;
    CurlTrack input_curl_;
    std::optional<HostileHand> hostile_;
    std::shared_ptr<WorkspaceFile> workspace_;
    std::unique_ptr<RingWriter<ContactFrame>> frames_;
    std::unique_ptr<RingReader<DeviceState>> states_;
    ContactFrame frame_{};
    Probe step_probe_;  // up during each step
    std::uint64_t late_ = 0;
    std::uint64_t workspace_changes_ = 0;
};

Run::Run(const RunOptions& options, const Plan& plan)
    : options_(options),
      steps_(plan.steps),
      simulation_(plan.scene, monotonic_now_ns),
      statistics_(plan.scene, !options.record.empty(), plan.steps > 0 ? plan.steps : kRoomAtLeast),
      step_probe_(open_probe(plan.scene.step_probe, &monotonic_now_ns, plan.scene.step_probe_slowest_edge_ns)) {
    simulation_.set_verification(options.verify);
    if (plan.hostile_seed) {
        hostile_.emplace(*plan.hostile_seed, kHostileSpeed, kHostileTurn, simulation_.proxy());
    }
    workspace_ = plan.workspace;
    if (!options.input.empty()) {
        input_ = std::make_unique<PoseTrack>(PoseTrack::load(options.input));
        input_curl_ = CurlTrack::load(options.input);
    }
    if (!options.snapshots.empty()) {
        snapshots_ = std::make_unique<Snapshots>(simulation_);
    }
    if (!plan.session.empty()) {
        frames_ = std::make_unique<RingWriter<ContactFrame>>(plan.session);
    }
    if (plan.real) {
        states_ = std::make_unique<RingReader<DeviceState>>(plan.session);
        if (const std::string others = describe_other_users(plan.session); !others.empty()) {
            spdlog::warn("{}", others);
        }
    }
}

void Run::one_step(const StepInput& input) {
    if (snapshots_) {
        snapshots_->before_step();
    }
    step_probe_.set(true);
    const StepResult result = simulation_.step(input);
    if (frames_) {
        frame_ = simulation_.frame();
        const std::int64_t now_ns = monotonic_now_ns();
        frame_.publish_time_ns = states_ ? now_ns : input.time_ns;
        (void)frames_->publish(frame_, now_ns);
    }
    step_probe_.set(false);
    statistics_.add(input, result);
    if (snapshots_) {
        snapshots_->after_step(result);
    }
}

void Run::follow_workspace(std::int64_t now_ns) {
    if (!workspace_) {
        return;
    }
    if (const std::optional<WorkspaceSettings> next = workspace_->look(now_ns)) {
        simulation_.change_workspace(*next);
        ++workspace_changes_;
        spdlog::info("workspace: scale {}, force scale {}, clutch button {}", next->scale, next->force_scale,
                     next->clutch_button);
    } else if (!workspace_->complaint().empty()) {
        spdlog::warn("the workspace stays as it is: {}", workspace_->complaint());
    }
}

void Run::follow_input(StepInput& input, std::int64_t time_ns) const {
    input.device = input_->at(time_ns);
    input.curl.reset();
    if (input_curl_.known()) {
        input.curl = input_curl_.at(time_ns);
    }
}

void Run::run_lockstep() {
    const std::int64_t step_ns = nanoseconds(simulation_.scene().solver.step);
    for (std::int64_t time_ns = 0; wanted(); time_ns += step_ns) {
        StepInput input = simulation_.scripted_input(time_ns);
        if (input_) {
            follow_input(input, time_ns);
        } else if (hostile_) {
            const Vec3 hand = hostile_->after(simulation_.scene().solver.step, simulation_.vertices());
            input.device = simulation_.workspace().to_device(Pose{hand, hostile_->orientation()});
            input.curl = hostile_->curl();
        }
        one_step(input);
    }
}

void Run::wait_for_device(DeviceHand& hand) {
    const std::int64_t until_ns = monotonic_now_ns() + nanoseconds(options_.wait_s);
    for (std::int64_t now_ns = monotonic_now_ns(); now_ns < until_ns && stop_requested == 0;
         now_ns = monotonic_now_ns()) {
        (void)hand.at(now_ns, now_ns);
        if (hand.fresh() && hand.safety_state() == HAPTIC_RUNNING) {
            return;
        }
        frames_->beat(now_ns);
        sleep_until(now_ns + kLookEveryNs);
    }
}

void Run::run_real(RingReader<DeviceState>& states) {
    const std::int64_t step_ns = nanoseconds(simulation_.scene().solver.step);
    DeviceHand hand(states, simulation_.scripted_input(0));
    if (options_.wait_s > 0.0) {
        wait_for_device(hand);
    }
    bool was_fresh = true;  // so that a device that is missing from the beginning is said
    const std::int64_t start_ns = monotonic_now_ns();
    for (std::int64_t deadline_ns = start_ns; wanted(); deadline_ns += step_ns) {
        sleep_until(deadline_ns);
        const std::int64_t now_ns = monotonic_now_ns();
        if (now_ns >= deadline_ns + step_ns) {
            // The phase is kept, the scene falls behind by whole steps.
            late_ += static_cast<std::uint64_t>((now_ns - deadline_ns) / step_ns);
            deadline_ns += (now_ns - deadline_ns) / step_ns * step_ns;
        }
        StepInput input = hand.at(deadline_ns, now_ns);
        if (input_) {
            follow_input(input, deadline_ns - start_ns);
        } else if (hand.fresh() != was_fresh) {
            was_fresh = hand.fresh();
            spdlog::info(was_fresh ? "the device is there: the hand follows it"
                                   : "no fresh device state: the hand stays where it is until rt-core publishes one");
        }
        one_step(input);
        follow_workspace(now_ns);
    }
    if (late_ > 0) {
        spdlog::warn("{} step deadlines were missed; the scene ran slower than real time by as many steps", late_);
    }
    if (hand.rejected() > 0) {
        spdlog::warn("{} device states were not valid and were ignored", hand.rejected());
    }
}

nlohmann::json Run::probe_report() const {
    const std::optional<GpioLine>& line = simulation_.scene().step_probe;
    if (!line) {
        return nullptr;
    }
    return {{"line", line->line + " of " + line->chip},
            {"edges", step_probe_.edges()},
            {"off", step_probe_.off()},
            {"error", step_probe_.off() ? std::system_category().message(step_probe_.error()) : ""}};
}

void Run::write_results(double wall_s) const {
    if (step_probe_.off()) {
        spdlog::warn("probe off after {} edges: the kernel refused one: {}", step_probe_.edges(),
                     std::system_category().message(step_probe_.error()));
    }
    if (!options_.report.empty()) {
        nlohmann::json report = statistics_.report(simulation_, wall_s, options_.verify);
        report["clock"] = options_.clock;
        report["late_steps"] = late_;
        report["workspace_changes"] = workspace_changes_;
        report["probe"] = probe_report();
        write_report(options_.report, report);
    }
    if (!options_.record.empty()) {
        statistics_.write_record(options_.record);
    }
    if (snapshots_) {
        for (const std::filesystem::path& file : snapshots_->write(options_.snapshots)) {
            spdlog::info("wrote {}", file.string());
        }
    }
    std::cout << statistics_.summary(simulation_, wall_s, options_.verify) << std::flush;
}

int Run::go() {
    const Scene& scene = simulation_.scene();
    spdlog::info("{}: {}; {} clock, step {} s", scene.name, scene.description, options_.clock, scene.solver.step);
    const std::int64_t start_ns = monotonic_now_ns();
    if (states_) {
        run_real(*states_);
    } else {
        run_lockstep();
    }
    const double wall_s = seconds(monotonic_now_ns() - start_ns);
    frames_.reset();  // leaves the rings before anything slow is done
    states_.reset();
    if (stop_requested != 0) {
        spdlog::info("stopped by a signal after {} steps", statistics_.steps());
    }
    write_results(wall_s);
    if (options_.verify && statistics_.escapes() > 0) {
        spdlog::error("the proxy's centre passed through a surface in {} steps", statistics_.escapes());
        return 1;
    }
    return 0;
}

void log_to_stderr() {
    auto logger = std::make_shared<spdlog::logger>("host-sim", std::make_shared<spdlog::sinks::stderr_sink_st>());
    logger->set_pattern("host-sim: %v");
    spdlog::set_default_logger(std::move(logger));
}

}  // namespace

Command add_run_command(CLI::App& app) {
    const auto options = std::make_shared<RunOptions>();
    app.add_option("scene", options->scene, "A built-in scene (host-sim scenes) or a scene file, NAME.toml")
        ->required();
    app.add_option("--set", options->assignments, "Override a key of the scene, e.g. solver.iterations=5; repeatable")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    app.add_option("--session", options->session,
                   "Name of the rings that join this process to rt-core; with --clock lockstep, frames are published "
                   "only if it is given [default]");
    auto* duration = app.add_option("--duration", options->duration_s, "Simulated seconds; 0 runs until stopped")
                         ->check(CLI::Range(0.0, 1e6));
    app.add_option("--steps", options->steps, "Number of steps; 0 runs until stopped")->excludes(duration);
    app.add_option("--clock", options->clock,
                   "real: paced, the hand is the device of rt-core; lockstep: as fast as can be, the hand is the "
                   "scene's script or --input")
        ->check(CLI::IsMember({"real", "lockstep"}))
        ->capture_default_str();
    app.add_option("--input", options->input,
                   "Follow a recorded hand: time_s, x_m, y_m, z_m, ... in the device frame; curl, if there is such a "
                   "column, closes it");
    app.add_option("--hand", options->hand,
                   "With --clock lockstep: script, the scene's own; hostile or hostile:SEED, one that darts at the "
                   "surfaces at up to 5 m/s, to be used with --verify")
        ->capture_default_str();
    app.add_option(
        "--workspace", options->workspace,
        "A file with a table [workspace] in place of the scene's; with --clock real it is taken anew, without "
        "a jump of the force, whenever it changes");
    app.add_option("--wait", options->wait_s,
                   "With --clock real: seconds to hold the scene back at most, until rt-core is running")
        ->check(CLI::Range(0.0, 3600.0));
    app.add_option("--report", options->report, "Write a JSON report at the end");
    app.add_option("--record", options->record, "Write a CSV record of every step at the end");
    app.add_option("--snapshots", options->snapshots, "Write POV-Ray scenes of the moments round the contact there");
    app.add_flag("--verify", options->verify,
                 "Check every step independently for a proxy that passed through a surface; exit status 1 if one did");
    return [options] {
        log_to_stderr();
        return Run(*options).go();
    };
}

Command add_scenes_command(CLI::App& app) {
    (void)app;
    return [] {
        for (const BuiltInScene& scene : built_in_scenes()) {
            const Config config = open_scene(std::string(scene.name));
            std::cout << scene.name << ": " << read_scene(config, std::string(scene.name)).description << '\n';
        }
        return 0;
    };
}

}  // namespace haptic::sim
