#include "app/live_control.hpp"

#include <algorithm>
#include <utility>
#include <variant>

#include "haptic/types.hpp"
#include "view/capture.hpp"

namespace haptic::sim {
namespace {

constexpr std::int64_t kMeasureNs = 250'000'000;  // period of speed measurements

}  // namespace

bool change_parameter(Simulation& simulation, const view::LiveParameters& parameters, const view::SetParameter& change,
                      Recordings& recordings) {
    const LiveSettings before = simulation.settings();
    const LiveSettings next = parameters.with(before, change.parameter, change.value);
    if (next == before) {
        return false;
    }
    simulation.change_settings(next);
    recordings.note(simulation.steps(), parameters.assignment(next, change.parameter));
    return true;
}

void LiveControl::introduce(Simulation& simulation, const LiveSettings& own, HandSources& hand) {
    simulation_ = &simulation;
    hand_ = &hand;
    parameters_ = std::make_unique<view::LiveParameters>(simulation, own);
    result_ = {};
    measured_s_ = 0.0;
    view::SceneDescription description = view::describe(simulation);
    description.parameters = parameters_->descriptions();
    view_->set_scene(description);
}

void LiveControl::serve() {
    for (view::Command command; view_->next_command(command);) {
        std::visit([this](const auto& what) { handle(what); }, command);
    }
    if (std::optional<std::string> csv = recordings_.take_offer()) {
        view_->offer_record(std::move(*csv));
    }
}

std::optional<SceneRequest> LiveControl::take_request() {
    return std::exchange(request_, std::nullopt);
}

void LiveControl::handle(const view::SetParameter& command) {
    counts_.changes += change_parameter(*simulation_, *parameters_, command, recordings_) ? 1U : 0U;
}

void LiveControl::handle(const view::SetPaused& command) {
    paused_ = command.paused;
    single_steps_ = 0;
}

void LiveControl::handle(const view::SingleStep& command) {
    single_steps_ = paused_ ? command.steps : 0;
}

void LiveControl::handle(const view::Reset& /*command*/) {
    request_ = SceneRequest{};
}

void LiveControl::handle(const view::ChangeScene& command) {
    request_ = SceneRequest{command.name, command.made};
}

void LiveControl::handle(const view::SetRecording& command) {
    if (command.on) {
        recordings_.start_offer(simulation_->steps());
    } else {
        recordings_.finish_offer();
    }
}

void LiveControl::handle(const view::MoveHand& command) {
    hand_->move(*simulation_, command);
}

void LiveControl::handle(const view::ReleaseHand& /*command*/) {
    hand_->release();
}

void LiveControl::handle(const view::FollowScript& /*command*/) {
    hand_->follow_script(*simulation_);
}

void LiveControl::after_step(const StepResult& result, std::uint64_t late_steps, std::int64_t now_ns) {
    result_ = result;
    late_steps_ = late_steps;
    single_steps_ -= single_steps_ > 0 ? 1 : 0;
    view_->add_sample(view::sample_of(result));
    show(now_ns);
}

void LiveControl::measure_speed(std::int64_t now_ns) {
    if (now_ns - measured_ns_ < kMeasureNs) {
        return;
    }
    const double passed = seconds(now_ns - measured_ns_);
    speed_ = measured_ns_ > 0 ? std::max(0.0, simulation_->time() - measured_s_) / passed : 0.0;
    measured_ns_ = now_ns;
    measured_s_ = simulation_->time();
}

void LiveControl::show(std::int64_t now_ns) {
    measure_speed(now_ns);
    view::SceneSnapshot* const moment = view_->requested_snapshot();
    if (moment == nullptr) {
        return;
    }
    view::capture(*simulation_, result_, *moment);
    moment->run = {.paused = paused_,
                   .recording = recordings_.offering(),
                   .recorded_steps = recordings_.offered_steps(),
                   .hand = hand_->source(),
                   .speed = speed_,
                   .late_steps = late_steps_,
                   .parameters = parameters_->values(simulation_->settings())};
    view_->publish_snapshot();
}

}  // namespace haptic::sim
