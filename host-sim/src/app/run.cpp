#include "app/run.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <exception>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "app/background.hpp"
#include "app/unresolved_motion.hpp"
#include "dynamics/workers.hpp"
#include "haptic/clock.hpp"
#include "haptic/csv.hpp"
#include "haptic/other_users.hpp"
#include "haptic/report.hpp"
#include "program/exit_status.hpp"
#include "program/log.hpp"
#include "program/results.hpp"
#include "view/live_parameters.hpp"

namespace haptic::sim {
namespace {

// Polling period while waiting for the device.
constexpr std::int64_t kPollPeriodNs = 1'000'000;
// The same in the device's time, in which rt-core waits for each step.
constexpr std::int64_t kDevicePollNs = 20'000;
// Silence of the device after which a run in its time ends.
constexpr std::int64_t kMaxSilenceNs = 60 * kNanosecondsPerSecond;

/// Leaves rt-core of the session a processor of its own, unless the scene says how many threads there are.
Scene with_threads(Scene scene, const std::string& session) {
    if (scene.solver.threads == 0 && !session.empty()) {
        scene.solver.threads = std::max(1, std::min(usable_processors() - 1, Workers::kMaxChosen));
    }
    return scene;
}

}  // namespace

Run::Run(const RunOptions& options, const Plan& plan, std::unique_ptr<view::LiveView> view)
    : options_(options),
      session_(plan.session),
      steps_(plan.steps),
      duration_s_(plan.duration_s),
      clock_(plan.clock),
      scene_(plan.scene),
      scene_settings_(live_settings_of(plan.scene)),
      origin_(plan.origin),
      simulation_(with_progress_bar("building " + plan.scene.name,
                                    [&](const Progress& progress) {
                                        return Simulation(with_threads(plan.scene, plan.session), monotonic_now_ns,
                                                          progress);
                                    })),
      statistics_(),
      recordings_(options.record, plan.clock != RunClock::Lockstep),
      workspace_(plan.workspace),
      frames_(plan.session.empty() ? nullptr : std::make_unique<ContactFramePublisher>(plan.session)),
      states_(plan.clock != RunClock::Lockstep ? std::make_unique<RingReader<DeviceState>>(plan.session) : nullptr),
      hand_(plan.hand, states_.get()),
      settings_seed_(plan.settings_seed),
      step_probe_(open_probe(plan.scene.step_probe, &monotonic_now_ns, plan.scene.step_probe_slowest_edge_ns)) {
    if (states_) {
        if (const std::string others = describe_other_users(plan.session); !others.empty()) {
            spdlog::warn("{}", others);
        }
    }
    if (view) {
        live_ = std::make_unique<LiveControl>(std::move(view), recordings_);
    }
    start_scene();
}

/// Resets everything that belongs to one simulation.
void Run::start_scene() {
    simulation_.set_verification(options_.verify);
    statistics_ = {};
    recordings_.begin(origin_);
    snapshots_ = options_.snapshots.empty() ? nullptr : std::make_unique<Snapshots>(simulation_);
    hand_.begin(simulation_);
    if (settings_seed_) {
        random_settings_.emplace(*settings_seed_, simulation_, scene_settings_, origin_.assignments);
    }
    start_ns_ = monotonic_now_ns();
    scene_ns_ = 0;
    unstable_ = false;
    if (live_) {
        live_->introduce(simulation_, scene_settings_, hand_);
    }
}

/// How much of the run is done, none of one without an end. The last step ends nearest to its duration, as long as
/// steps stay as they are. A run makes at least one.
double Run::part_done() const {
    if (statistics_.steps() == 0) {
        return 0.0;
    }
    if (steps_ > 0) {
        return static_cast<double>(statistics_.steps()) / static_cast<double>(steps_);
    }
    const double nearest_s = seconds(scene_ns_) + 0.5 * simulation_.scene().solver.step;
    return duration_s_ > 0.0 ? nearest_s / duration_s_ : 0.0;
}

/// Whether another step is to be made. Shows how far the run is, unless it ends by a signal only.
bool Run::should_continue() {
    const double done = part_done();
    if (progress_) {
        progress_->show(std::min(done, 1.0));
    }
    return !stop_requested() && done < 1.0;
}

/// Makes a step. False if the simulation diverged, or cannot be solved, under settings changed by viewers: it is then
/// rebuilt with the scene's own settings, paused. Without such changes the error ends the run.
bool Run::try_step(const StepInput& input, StepResult& result) {
    if (!live_ || live_->counts().changes == 0) {
        result = simulation_.step(input);
        return true;
    }
    try {
        result = simulation_.step(input);
        return true;
    } catch (const std::exception& error) {
        spdlog::error("{}. The scene restarts, paused, with its own parameters", error.what());
        simulation_.change_settings(scene_settings_);
        live_->pause();
        unstable_ = true;
        start_next_scene({});
        return false;
    }
}

/// Sends a step and its published frame to the viewers, and times that.
void Run::update_viewers(const StepResult& result, const Published& frame) {
    if (!live_) {
        return;
    }
    const std::int64_t begin_ns = monotonic_now_ns();
    if (frame.sequence != 0) {
        live_->frame_published(frame.sequence, frame.time_ns);
    }
    live_->after_step(result, late_, begin_ns);
    viewer_times_.record(monotonic_now_ns() - begin_ns);
}

Run::Published Run::publish(const StepInput& input) {
    if (!frames_) {
        return {};
    }
    const std::int64_t now_ns = monotonic_now_ns();
    return {frames_->publish(simulation_.frame(), clock_ == RunClock::Real ? now_ns : input.time_ns, now_ns), now_ns};
}

void Run::change_settings_at_random() {
    if (!random_settings_) {
        return;
    }
    if (const std::optional<view::SetParameter> change = random_settings_->advance(simulation_.scene().solver.step)) {
        (void)change_parameter(simulation_, random_settings_->parameters(), *change, recordings_);
    }
}

void Run::make_step(const HandSources::Times& times) {
    change_settings_at_random();
    // The hand may have moved away from the tool while the run was idle or the device absent: couple them again from
    // zero force.
    const StepInput input = hand_.at(simulation_, times);
    if (live_ && frames_ && hand_.source() == view::HandSource::Device && (was_idle_ || hand_.device_appeared())) {
        simulation_.recouple();
        recordings_.note(simulation_.steps(), std::string(kRecouple));
    }
    was_idle_ = false;
    if (snapshots_) {
        snapshots_->before_step();
    }
    // The probe line brackets step and publication, for measurement at a pin.
    step_probe_.set(true);
    StepResult result;
    const bool made = try_step(input, result);
    const Published frame = made ? publish(input) : Published{};
    step_probe_.set(false);
    if (!made) {
        return;
    }
    // Everything below happens after the frame is on its way.
    report_stiffness_limit(input);
    scene_ns_ += nanoseconds(result.step);
    statistics_.add(result);
    recordings_.add(input, result);
    if (snapshots_) {
        snapshots_->after_step(result);
    }
    update_viewers(result, frame);
}

/// Says once that the device renders less than the scene asks for.
void Run::report_stiffness_limit(const StepInput& input) {
    if (told_stiffness_limit_ || !input.feedback || !input.feedback->stiffness_limited) {
        return;
    }
    told_stiffness_limit_ = true;
    spdlog::warn(
        "the scene asks for a stiffness of {:.0f} N/m at the hand, the device renders {:.0f} N/m, and the bodies feel "
        "no more",
        simulation_.frame().stiffness, input.feedback->stiffness);
}

void Run::follow_workspace(std::int64_t now_ns) {
    if (!workspace_) {
        return;
    }
    if (const std::optional<WorkspaceSettings> next = workspace_->poll(now_ns)) {
        simulation_.change_workspace(*next);
        for (const std::string& assignment : assignments_of(*next)) {
            recordings_.note(simulation_.steps(), assignment);
        }
        ++workspace_changes_;
        spdlog::info("workspace: scale {}, force scale {}, clutch button {}", next->scale, next->force_scale,
                     next->clutch_button);
    } else if (!workspace_->error().empty()) {
        spdlog::warn("workspace unchanged: {}", workspace_->error());
    }
}

/// Executes viewers' commands. False if the run is idle.
bool Run::serve() {
    if (!live_) {
        return true;
    }
    live_->serve();
    if (const std::optional<SceneRequest> request = live_->take_request()) {
        start_next_scene(*request);
    }
    switch_to_next_scene();
    return !next_ && !live_->is_idle();
}

/// One idle period: serves the haptic loop and the viewers without stepping.
void Run::idle() {
    const std::int64_t now_ns = monotonic_now_ns();
    was_idle_ = true;
    if (frames_) {
        if (const std::uint64_t sequence = frames_->publish_idle(now_ns); sequence != 0) {
            live_->frame_published(sequence, now_ns);
        }
    }
    if (!unstable_) {
        live_->show(now_ns);
    }
    sleep_until(now_ns + ContactFramePublisher::kIdlePeriodNs);
}

/// Lets a restarted scene keep the changes made while it ran, as assignments in its record.
void Run::carry_over_changes(NextScene& next) const {
    Scene& scene = next.scene;
    std::vector<std::string>& assignments = next.origin.assignments;
    for (std::string& assignment : view::LiveParameters(simulation_, scene_settings_)
                                       .assignments(live_settings_of(scene), simulation_.settings())) {
        assignments.push_back(std::move(assignment));
    }
    apply(simulation_.settings(), scene);
    if (workspace_) {
        scene.workspace = workspace_->settings();
        for (std::string& assignment : assignments_of(scene.workspace)) {
            assignments.push_back(std::move(assignment));
        }
    }
}

void Run::start_next_scene(const SceneRequest& request) {
    if (next_) {
        return;  // one at a time: later requests are dropped
    }
    NextScene next{scene_, origin_, {}};
    try {
        if (request.scene.empty()) {
            carry_over_changes(next);
        } else if (request.made) {
            next.scene = *request.made;
            // What host-sim new-scene writes for the same mesh, by which a recording can be played.
            next.origin = {.scene = request.scene + ".toml", .assignments = {}, .first_step = 0, .changes = {}};
        } else {
            next.scene = read_scene(open_scene(request.scene), request.scene);
            next.origin = {.scene = request.scene, .assignments = {}, .first_step = 0, .changes = {}};
        }
    } catch (const std::exception& error) {
        spdlog::error("scene unchanged: {}", error.what());
        return;
    }
    // Building takes longer than a step.
    next.made =
        in_background([scene = with_threads(next.scene, session_)] { return Simulation(scene, monotonic_now_ns); });
    next_ = std::move(next);
}

/// Switches to the next simulation once it is built and the force of the current one has faded out.
void Run::switch_to_next_scene() {
    if (!next_ || next_->made.wait_for(std::chrono::seconds(0)) != std::future_status::ready) {
        return;
    }
    if (frames_ && hand_.source() == view::HandSource::Device && !frames_->faded()) {
        return;
    }
    NextScene next = std::move(*next_);
    next_.reset();
    try {
        simulation_ = next.made.get();
    } catch (const std::exception& error) {
        spdlog::error("scene unchanged: {}", error.what());
        return;
    }
    const bool is_other = next.origin.scene != origin_.scene || next.scene.model.mesh != scene_.model.mesh;
    if (is_other) {
        workspace_.reset();  // belonged to the other scene
        scene_settings_ = live_settings_of(next.scene);
    }
    live_->count(is_other);
    scene_ = std::move(next.scene);
    origin_ = std::move(next.origin);
    start_scene();
}

void Run::run_lockstep() {
    while (should_continue()) {
        if (serve()) {
            make_step({.scene_ns = scene_ns_, .step_ns = scene_ns_, .now_ns = 0});
            continue;
        }
        idle();
    }
}

void Run::wait_for_device() {
    DeviceHand& device = *hand_.device();
    const std::int64_t until_ns = monotonic_now_ns() + nanoseconds(options_.wait_s);
    for (std::int64_t now_ns = monotonic_now_ns(); now_ns < until_ns && !stop_requested();
         now_ns = monotonic_now_ns()) {
        (void)device.at(now_ns, now_ns);
        if (device.fresh() && device.safety_state() == HAPTIC_RUNNING) {
            return;
        }
        frames_->beat(now_ns);
        if (live_) {
            live_->show(now_ns);
        }
        sleep_until(now_ns + kPollPeriodNs);
    }
    if (!stop_requested()) {
        const std::string waited = " within --wait " + haptic::text_of(CsvCell{options_.wait_s}) + " s; ";
        throw std::runtime_error(options_.dds_interface.empty()
                                     ? "no rt-core ran in session " + session_ + waited +
                                           "start it with rt-core run --session " + session_ + ", or leave out --wait"
                                     : "no rt-core was heard through interface " + options_.dds_interface + waited +
                                           "on its machine start rt-core run and rt-core relay, or leave out --wait");
    }
}

void Run::log_device_freshness() {
    const bool fresh = hand_.device()->fresh();
    if (hand_.source() == view::HandSource::Input || fresh == was_fresh_) {
        return;
    }
    was_fresh_ = fresh;
    if (fresh) {
        spdlog::info("device found: the hand follows it");
    } else if (hand_.source() == view::HandSource::Script) {
        spdlog::info(
            "no fresh device state in session {}: the hand follows the scene's script until rt-core publishes one",
            session_);
    } else {
        spdlog::info("no fresh device state in session {}: the hand stays in place until rt-core publishes one",
                     session_);
    }
}

void Run::run_real() {
    if (options_.wait_s > 0.0) {
        wait_for_device();
    }
    std::int64_t start_ns = monotonic_now_ns();  // time 0 of a recorded input
    for (std::int64_t deadline_ns = start_ns; should_continue();) {
        if (!serve()) {
            idle();
            const std::int64_t now_ns = monotonic_now_ns();
            start_ns += now_ns - deadline_ns;  // idle time does not count
            deadline_ns = now_ns;
            continue;
        }
        sleep_until(deadline_ns);
        const std::int64_t now_ns = monotonic_now_ns();
        const std::int64_t step_ns = nanoseconds(simulation_.scene().solver.step);
        if (now_ns >= deadline_ns + step_ns) {
            // Overrun: keep the phase, skip whole periods. The scene falls behind real time by as many steps.
            late_ += static_cast<std::uint64_t>((now_ns - deadline_ns) / step_ns);
            deadline_ns += (now_ns - deadline_ns) / step_ns * step_ns;
        }
        const bool recorded = hand_.source() == view::HandSource::Input;
        make_step(
            {.scene_ns = recorded ? deadline_ns - start_ns : scene_ns_, .step_ns = deadline_ns, .now_ns = now_ns});
        log_device_freshness();
        follow_workspace(now_ns);
        deadline_ns += nanoseconds(simulation_.scene().solver.step);
    }
    if (late_ > 0) {
        spdlog::warn("{} step deadlines missed: the scene fell behind real time by as many steps", late_);
    }
    if (const std::uint64_t rejected = hand_.device()->rejected(); rejected > 0) {
        spdlog::warn("{} invalid device states ignored", rejected);
    }
}

/// Makes each step with the first state that is as late as the step's beginning. If rt-core then waits for the frame,
/// the two processes run in lockstep, and the result does not depend on how fast either is.
void Run::run_device() {
    DeviceHand& device = *hand_.device();
    std::int64_t begin_ns = 0;  // of the next step; 0: at the first state of a running device
    std::int64_t heard_ns = monotonic_now_ns();
    while (should_continue()) {
        const std::int64_t last_ns = device.latch_time_ns();
        (void)device.at(begin_ns, last_ns);
        const std::int64_t state_ns = device.latch_time_ns();
        const std::int64_t now_ns = monotonic_now_ns();
        heard_ns = state_ns != last_ns ? now_ns : heard_ns;
        if (begin_ns == 0 && device.safety_state() == HAPTIC_RUNNING) {
            begin_ns = state_ns;
        }
        if (begin_ns == 0 || state_ns < begin_ns) {
            if (now_ns - heard_ns > kMaxSilenceNs) {
                throw std::runtime_error("no device state for a minute: is rt-core running in session \"" +
                                         options_.session + "\"?");
            }
            sleep_until(now_ns + kDevicePollNs);
            continue;
        }
        make_step({.scene_ns = scene_ns_, .step_ns = begin_ns, .now_ns = state_ns});
        begin_ns += nanoseconds(simulation_.scene().solver.step);
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

nlohmann::json Run::view_report() const {
    if (!live_) {
        return nullptr;
    }
    const ViewCounts& counts = live_->counts();
    return {{"url", live_->url()},
            {"changes", counts.changes},
            {"resets", counts.resets},
            {"scenes", counts.scenes},
            {"us", summary_us(viewer_times_)}};
}

nlohmann::json Run::report(double wall_s) const {
    nlohmann::json report = statistics_.report(simulation_, wall_s, options_.verify);
    report["clock"] = name_of(clock_);
    report["late_steps"] = late_;
    report["workspace_changes"] = workspace_changes_;
    report["probe"] = probe_report();
    report["view"] = view_report();
    return report;
}

void Run::write_results(double wall_s, Results& results) {
    if (step_probe_.off()) {
        spdlog::warn("probe switched off after {} edges: {}", step_probe_.edges(),
                     std::system_category().message(step_probe_.error()));
    }
    results.write([this] { recordings_.close(); });
    if (!options_.report.empty()) {
        results.write([&] { write_report(options_.report, report(wall_s)); });
    }
    if (snapshots_) {
        results.write([this] {
            for (const std::filesystem::path& file : snapshots_->write(options_.snapshots)) {
                spdlog::info("wrote {}", file.string());
            }
        });
    }
    std::cout << statistics_.summary(simulation_, wall_s, options_.verify) << std::flush;
    for (const std::string& problem : results.problems()) {
        spdlog::error("{}", problem);
    }
}

void Run::run_clock() {
    switch (clock_) {
        case RunClock::Lockstep:
            return run_lockstep();
        case RunClock::Real:
            return run_real();
        case RunClock::Device:
            return run_device();
    }
}

int Run::execute() {
    const Scene& scene = simulation_.scene();
    spdlog::info("{}: {}; {} clock, step {} s", scene.name, scene.description, name_of(clock_), scene.solver.step);
    warn_unless_empty(unresolved_motion(simulation_));
    if (live_) {
        spdlog::info("the live view is at {}", live_->url());
    }
    start_ns_ = monotonic_now_ns();
    if (steps_ > 0 || duration_s_ > 0.0) {
        progress_.emplace("running " + scene.name);
    }
    // An error ends the run, but not what was measured before it.
    std::exception_ptr error;
    try {
        run_clock();
    } catch (...) {
        error = std::current_exception();
    }
    const double wall_s = seconds(monotonic_now_ns() - start_ns_);
    progress_.reset();
    frames_.reset();  // release the rings before slow work
    states_.reset();
    if (stop_requested()) {
        spdlog::info("stopped by a signal after {} steps", statistics_.steps());
    }
    Results results;
    write_results(wall_s, results);
    if (error) {
        std::rethrow_exception(error);
    }
    const std::vector<std::string> violations = options_.verify ? statistics_.violations() : std::vector<std::string>();
    for (const std::string& violation : violations) {
        spdlog::error("{}", violation);
    }
    return violations.empty() ? results.status(kExitDone) : kExitFailed;
}

}  // namespace haptic::sim
