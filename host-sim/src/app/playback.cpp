#include "app/playback.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>
#include <variant>

#include "view/capture.hpp"

namespace haptic::sim {
namespace {

view::SceneDescription describe_recording(const Simulation& simulation, double length) {
    view::SceneDescription description = view::describe(simulation);
    description.scenes.clear();  // a recording has no other scene
    description.length = length;
    return description;
}

}  // namespace

Playback::Playback(Replay& replay, const RecordedRun& record, view::LiveView& view)
    : replay_(replay), view_(view), length_(record.length()), moments_(view::describe(replay.simulation())) {
    samples_.reserve(record.rows());
    view_.set_scene(describe_recording(replay.simulation(), length_));
    thread_ = std::thread([this] { compute(); });
}

Playback::~Playback() {
    stop_ = true;
    thread_.join();
}

void Playback::keep(const StepResult& result, view::SceneSnapshot& moment) {
    {  // every step for the plots, snapshots at the store's rate
        const std::lock_guard lock(samples_mutex_);
        samples_.push_back(view::sample_of(result));
    }
    if (moments_.wants(replay_.simulation().time())) {
        view::capture(replay_.simulation(), result, moment);
        moments_.add(moment);
    }
    buffered_ = std::min(replay_.simulation().time(), length_);
    if (replay_.diverged_at() && !diverged_) {
        diverged_ = true;
        spdlog::warn(
            "the replay differs from the recording from row {} on: the scene is not that of the record, or the record "
            "is "
            "incomplete",
            *replay_.diverged_at() + 1);
    }
}

void Playback::compute() {
    try {
        view::SceneSnapshot moment;
        for (StepResult result; !stop_ && replay_.step(result);) {
            keep(result, moment);
        }
    } catch (const std::exception& error) {
        spdlog::error("replay stopped: {}", error.what());
    }
}

void Playback::handle(const view::SetPaused& command) {
    paused_ = command.paused;
    if (!paused_ && time_ >= length_) {
        handle(view::Seek{0.0});  // play at the end restarts
    }
}

void Playback::handle(const view::SingleStep& command) {
    if (paused_) {
        const double next = moments_.time_of_neighbour(time_, command.steps);
        show_samples(next);
        time_ = next;
    }
}

void Playback::handle(const view::Reset& /*command*/) {
    handle(view::Seek{0.0});
}

void Playback::handle(const view::Seek& command) {
    // Seek within the computed part; plots continue with the first sample from there on.
    time_ = std::clamp(command.time, 0.0, buffered());
    const std::lock_guard lock(samples_mutex_);
    const auto next = std::lower_bound(samples_.begin(), samples_.end(), time_,
                                       [](const view::StepSample& sample, double t) { return sample.time < t; });
    next_sample_ = static_cast<std::size_t>(next - samples_.begin());
}

void Playback::handle(const view::SetSpeed& command) {
    speed_ = command.speed;
}

void Playback::show_samples(double until) {
    const std::lock_guard lock(samples_mutex_);
    for (; next_sample_ < samples_.size() && samples_[next_sample_].time < until; ++next_sample_) {
        view_.add_sample(samples_[next_sample_]);
    }
}

void Playback::show_moment() {
    view::SceneSnapshot* const moment = view_.requested_snapshot();
    if (moment == nullptr || !moments_.find(time_, *moment)) {
        return;
    }
    moment->time = time_;
    moment->run = {};
    moment->run.paused = paused_;
    moment->run.hand = view::HandSource::Input;
    moment->run.speed = paused_ ? 0.0 : speed_;
    moment->run.buffered = buffered();
    moment->run.diverged = diverged();
    view_.publish_snapshot();
    seen_ = true;
}

void Playback::advance(double elapsed_s) {
    for (view::Command command; view_.next_command(command);) {
        std::visit([this](const auto& what) { handle(what); }, command);
    }
    // Playing never overtakes the simulating thread.
    if (!paused_ && seen_) {
        const double next = std::min(time_ + speed_ * elapsed_s, buffered());
        show_samples(next);
        time_ = next;
        paused_ = time_ >= length_;
    }
    show_moment();
}

}  // namespace haptic::sim
